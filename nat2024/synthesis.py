"""Whole night datasets on disk: rendered from nothing, or made from daytime ones."""

import logging
import multiprocessing
import os
import re
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from nat2024 import types
from nat2024.boxes import format_boxes, write_boxes
from nat2024.datasets.index import index_dataset, write_index
from nat2024.datasets.schema import INDEX_FILE, AnnotatedSequence
from nat2024.datasets.terms import attribute_term
from nat2024.datasets.writing import encode_image, write_sequence
from nat2024.errors import ArrayContract, FrameUnreadable, UsageError
from nat2024.files import write_atomic
from nat2024.night import Darkening, NightFrame, NightSequence, NightSettings, Truth, attributes
from nat2024.night.arrays import Light
from nat2024.night.ground import reflectance
from nat2024.night.scene import FRAME_RATE
from nat2024.night.sequence import ATTRIBUTES

Progress = Callable[[str], Any]
"""Called with the name of each finished sequence."""

_log = logging.getLogger("nat2024")
_PHOTOGRAPHS = (".jpg", ".jpeg", ".png")
_PHOTOGRAPH_SIDE = 512


class Synthesized(msgspec.Struct, frozen=True):
    """One rendered sequence.

    Attributes:
        name: of the sequence.
        frames: number of frames.
        target: what is tracked.
        seed: of the sequence.
        attributes: that it has, sorted.
        visible_share: share of frames in which the target counts as present.
        mean: mean grey level 0..1 that its first, middle and last frame were exposed to.
    """

    name: str
    frames: int
    target: str
    seed: int
    attributes: tuple[str, ...]
    visible_share: float
    mean: float


def names_of(settings: Sequence[NightSettings]) -> list[str]:
    """Names such as `car1`, `person1`, `car2`, in the order of the settings."""
    counts: dict[str, int] = {}
    names = []
    for one in settings:
        counts[one.target] = counts.get(one.target, 0) + 1
        names.append(f"{one.target}{counts[one.target]}")
    return names


def read_photographs(folder: str | os.PathLike[str], seed: int = 0) -> tuple[Light, ...]:
    """Reflectance of all photographs directly in a folder, at most 512 pixels wide.

    Raises:
        UsageError: there is none, or the folder is not there.
        FrameUnreadable: one cannot be decoded.
    """
    import cv2

    from nat2024.datasets.decoding import decode_image

    path = Path(folder)
    files = sorted(f for f in path.glob("*") if f.suffix.lower() in _PHOTOGRAPHS)
    if not files:
        msg = f"{path}: no photographs in it (.jpg or .png)"
        raise UsageError(msg)
    rng = np.random.default_rng([seed, 5])
    found = []
    for file in files:
        image = decode_image(file.read_bytes(), str(file))
        scale = min(1.0, _PHOTOGRAPH_SIDE / max(image.shape[:2]))
        small = cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
        found.append(reflectance(np.asarray(small, dtype=np.uint8), rng))
    return tuple(found)


def refuse_filled(folder: Path) -> None:
    """Raise `UsageError` where a folder to be written has something in it."""
    if folder.is_dir() and any(folder.iterdir()):
        msg = f"{folder} is not empty; choose another folder"
        raise UsageError(msg)


def synthesize(
    folder: str | os.PathLike[str],
    settings: Sequence[NightSettings],
    *,
    extension: str = ".jpg",
    quality: int | None = None,
    workers: int = 1,
    progress: Progress | None = None,
) -> tuple[Synthesized, ...]:
    """Render night sequences into a new folder.

    Its layout is that of UAVDark135: `data_seq/NAME/00001.jpg`, `anno/NAME.txt`, `att/NAME.txt`
    (columns as `nat2024.night.sequence.ATTRIBUTES`), and `data_seq/NAME/cover.label` with the
    visible share in eighths as in GOT-10k; an index says all of it again.

    Args:
        folder: absent or empty.
        settings: of each sequence; they are named after their targets.
        extension: `.jpg`, or `.png` for frames without loss.
        quality: of JPEG, 1..100; None takes that of each rendered camera.
        workers: processes that render sequences at the same time.
        progress: told of each finished sequence.

    Raises:
        UsageError: the folder is not empty, or a setting cannot be used.
    """
    folder = Path(folder)
    refuse_filled(folder)
    jobs = list(zip(names_of(settings), settings, strict=True))
    made = []
    for one in _render_all(folder, jobs, extension, quality, workers):
        made.append(one)
        if progress:
            progress(one.name)
    _index(folder, {one.name: dict.fromkeys(one.attributes, "published") for one in made})
    return tuple(made)


def _render_all(
    folder: Path,
    jobs: Sequence[tuple[str, NightSettings]],
    extension: str,
    quality: int | None,
    workers: int,
) -> Iterator[Synthesized]:
    if workers <= 1 or len(jobs) <= 1:
        for name, settings in jobs:
            yield _render(folder, name, settings, extension, quality)
        return
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(min(workers, len(jobs)), mp_context=context) as pool:
        futures = [pool.submit(_render, folder, n, s, extension, quality) for n, s in jobs]
        for future in futures:
            yield future.result()


def _render(
    folder: Path, name: str, settings: NightSettings, extension: str, quality: int | None
) -> Synthesized:
    """Render one sequence and write its files."""
    sequence = NightSequence(settings)
    bare: list[NightFrame] = []
    empty = np.empty((0, 0, 3), dtype=np.uint8)

    def pairs() -> Iterator[tuple[types.Image, types.Box]]:
        for frame in sequence:
            bare.append(replace(frame, image=empty))
            yield frame.image, frame.box

    level = sequence.sensor.quality if quality is None else quality
    write_sequence(folder, name, pairs(), extension, level)
    truth = Truth.of(bare)
    found = attributes(truth)
    cover = np.where(np.isfinite(truth.boxes).all(axis=1), np.rint(8 * truth.visible), 0)
    cover = np.where(np.isfinite(truth.boxes).all(axis=1), np.maximum(cover, 1), 0).astype(int)
    flags = ",".join(str(int(a in found)) for a in ATTRIBUTES)
    write_atomic(folder / "att" / f"{name}.txt", f"{flags}\n")
    write_atomic(folder / "data_seq" / name / "cover.label", "".join(f"{c}\n" for c in cover))
    return Synthesized(
        name,
        len(bare),
        settings.target,
        settings.seed,
        tuple(sorted(found)),
        float((cover > 0).mean()),
        sequence.mean,
    )


def _index(folder: Path, provenance: Mapping[str, Mapping[str, str]]) -> None:
    """Write the index of a folder, with the attributes that each sequence has."""
    document = index_dataset(folder, checksums=False)

    def with_attributes(record: AnnotatedSequence) -> AnnotatedSequence:
        return msgspec.structs.replace(record, attributes=dict(provenance.get(record.name, {})))

    document = msgspec.structs.replace(
        document,
        fps=FRAME_RATE,
        attributes=tuple(attribute_term(name) for name in ATTRIBUTES),
        sequences=tuple(with_attributes(record) for record in document.sequences),
    )
    write_index(document, folder / INDEX_FILE)


class Darkened(msgspec.Struct, frozen=True):
    """What became of one daytime sequence.

    Attributes:
        name: of the sequence.
        frames: number of frames written at each level; 0 where it failed.
        fault: why it failed, or empty.
    """

    name: str
    frames: int
    fault: str = ""


def level_folder(out: Path, name: str, level: float) -> Path:
    """Where the dataset of one level goes: `OUT/NAME-0.06`."""
    return out / f"{name}-{level:g}"


def level_of(name: str) -> tuple[str, float] | None:
    """The daytime dataset and the light level that `level_folder` puts into a name, None without.

    >>> level_of("uav123-0.06")
    ('uav123', 0.06)
    """
    match = re.fullmatch(r"(?P<day>.+)-(?P<level>0\.\d+)", name)
    return (match["day"], float(match["level"])) if match else None


def darken(
    dataset: types.Dataset,
    out: str | os.PathLike[str],
    levels: Sequence[float],
    *,
    seed: int = 0,
    extension: str = ".jpg",
    progress: Progress | None = None,
) -> tuple[Darkened, ...]:
    """Make night out of a daytime dataset, once for each light level, its ground truth kept.

    Each level becomes a dataset of its own, `OUT/NAME-LEVEL`, in the layout of UAVDark135: boxes
    (`anno/`, or `anno_keyframes/` where only some frames have one), visibility
    (`absence.label`) and attributes (`att/` and the index) as they were.

    Args:
        dataset: daytime sequences.
        out: folder that the datasets are written below.
        levels: mean grey levels 0..1 that the first frame of a sequence gets.
        seed: of lamps, camera and noise; each sequence has its own from it and its name.
        extension: `.jpg`, or `.png` for frames without loss.
        progress: told of each finished sequence.

    Returns:
        One entry a sequence; a sequence with a frame that cannot be read is left out at every
        level, and its entry says which frame.

    Raises:
        UsageError: a level out of range or given twice, or a folder is not empty.
    """
    Darkening(levels)  # refuses levels out of range before anything is written
    if len({f"{level:g}" for level in levels}) < len(levels):
        msg = f"a light level is given twice: {', '.join(f'{level:g}' for level in levels)}"
        raise UsageError(msg)
    folders = [level_folder(Path(out), dataset.name, level) for level in levels]
    for folder in folders:
        refuse_filled(folder)
    done = []
    for sequence in dataset:
        done.append(_darken(sequence, folders, Darkening(levels, _own(seed, sequence)), extension))
        if done[-1].fault:
            _log.error("%s: %s", sequence.name, done[-1].fault)
        if progress:
            progress(sequence.name)
    kept = [dataset[one.name] for one in done if not one.fault]
    for folder in folders if kept else []:
        _describe(folder, dataset, kept)
    return tuple(done)


def _own(seed: int, sequence: types.Sequence) -> int:
    """A seed for each sequence, whatever others the dataset holds."""
    letters = [ord(letter) for letter in sequence.name]
    return int(np.random.default_rng([seed, *letters]).integers(2**31))


def _darken(
    sequence: types.Sequence, folders: Sequence[Path], night: Darkening, extension: str
) -> Darkened:
    own = [folder / "data_seq" / sequence.name for folder in folders]
    with ExitStack() as undo:
        for folder in own:
            undo.callback(shutil.rmtree, folder, ignore_errors=True)
        try:
            for index in range(len(sequence)):
                images = night.darken(sequence.image(index))
                for folder, image in zip(own, images, strict=True):
                    raw = encode_image(image, extension, night.sensor.quality)
                    write_atomic(folder / f"{index + 1:05d}{extension}", raw)
        except (FrameUnreadable, ArrayContract) as error:
            return Darkened(sequence.name, 0, str(error))
        undo.pop_all()
    for folder in folders:
        _write_truth(folder, sequence)
    return Darkened(sequence.name, len(sequence))


def _write_truth(folder: Path, sequence: types.Sequence) -> None:
    if sequence.keyframes is not None:
        rows = format_boxes(sequence.boxes[sequence.keyframes]).splitlines()
        pairs = zip(sequence.keyframes + 1, rows, strict=True)
        text = "".join(f"{number},{row}\n" for number, row in pairs)
        write_atomic(folder / "anno_keyframes" / f"{sequence.name}.txt", text)
    elif len(sequence.boxes):
        write_boxes(folder / "anno" / f"{sequence.name}.txt", sequence.boxes)
    if sequence.visible is not None:
        flags = "".join(f"{int(not seen)}\n" for seen in sequence.visible)
        write_atomic(folder / "data_seq" / sequence.name / "absence.label", flags)


def _describe(folder: Path, dataset: types.Dataset, kept: Sequence[types.Sequence]) -> None:
    """Write attributes in the order of the daytime dataset, and the index."""
    names = dataset.attribute_names or tuple(sorted({a for s in kept for a in s.attributes}))
    for sequence in kept if names else ():
        flags = ",".join(str(int(name in sequence.attributes)) for name in names)
        write_atomic(folder / "att" / f"{sequence.name}.txt", f"{flags}\n")
    document = index_dataset(folder, checksums=False)
    by_name = {sequence.name: sequence for sequence in kept}
    records = []
    for record in document.sequences:
        day = by_name[record.name]
        known: dict[str, Any] = {a: day.provenance.get(a, "published") for a in day.attributes}
        words = {"category": day.category, "activity": day.activity}
        records.append(msgspec.structs.replace(record, attributes=known, **words))
    document = msgspec.structs.replace(
        document,
        attributes=tuple(attribute_term(name) for name in names),
        sequences=tuple(records),
    )
    write_index(document, folder / INDEX_FILE)
