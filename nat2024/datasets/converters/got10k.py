"""GOT-10k: a folder a sequence with `groundtruth.txt`, flags as `*.label` and `meta_info.ini`.

Frames are called `00000001.jpg` and so on, since the official toolkit sorts names as text; the
names they had are in `nat-bench-extra.json`, with all else that the format has no file for. The
official toolkit reads `.jpg` only: frames in other formats keep their ending.
"""

import configparser
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from nat2024.archives import is_stored
from nat2024.boxes import format_boxes
from nat2024.datasets.annotations import read_box_file, read_labels
from nat2024.datasets.converters.common import (
    Described,
    below,
    extra_file,
    find_extra,
    lines,
    merge,
    read_extra,
    renamed,
)
from nat2024.datasets.frames import FolderFrames
from nat2024.datasets.records import all_boxes, rows_of
from nat2024.datasets.schema import (
    AnnotatedDataset,
    AnnotatedSequence,
    KeptSequence,
    read_bytes,
)
from nat2024.errors import AnnotationInvalid

FORMAT = "got10k"

LABELS = {
    "absent": "absence.label",
    "cover": "cover.label",
    "cut_by_image": "cut_by_image.label",
}
META_FILE = "meta_info.ini"
_SECTION = "METAINFO"
_FULL_COVER = 8
_EXTRA = ("url", "begin", "end", "major_class", "root_class", "motion_adverb")
_FRAMES_PER_SECOND = "anno_fps"


def find(folder: Path) -> Path | None:
    """The side file in a folder of this format."""
    return find_extra(folder, FORMAT)


def read(path: Path, base: Path) -> Described:
    """Read a folder of this format with its side file."""
    document = merge(read_extra(path), str(base), lambda s: _read_native(base / s.name, s))
    frames = {
        s.name: FolderFrames(base / s.name, renamed(s.frames.files())) for s in document.sequences
    }
    return Described(document, frames, base, f"GOT-10k + {path.name}")


def frame_paths(document: AnnotatedDataset) -> dict[str, tuple[str, ...]]:
    """`NAME/00000001.jpg` and so on."""
    return {s.name: below(s.name, renamed(s.frames.files())) for s in document.sequences}


def files(document: AnnotatedDataset) -> Iterator[tuple[str, bytes]]:
    """`list.txt`, the files of every sequence, the side file last."""
    yield "list.txt", lines(s.name for s in document.sequences)
    for sequence in document.sequences:
        if sequence.boxes is not None:
            yield f"{sequence.name}/groundtruth.txt", format_boxes(all_boxes(sequence)).encode()
        size = sequence.resolution or document.resolution
        for field, values in _labels(sequence, size).items():
            yield f"{sequence.name}/{LABELS[field]}", lines(values)
        fps = sequence.fps or document.fps
        yield f"{sequence.name}/{META_FILE}", _meta(sequence, size, fps).encode()
    yield extra_file(document, FORMAT, _native)


def _native(sequence: AnnotatedSequence) -> tuple[str, ...]:
    labels = tuple(name for name in LABELS if getattr(sequence, name) is not None)
    rows = ("boxes",) if sequence.boxes is not None and sequence.keyframes is None else ()
    visible = sequence.visible
    follows = visible is not None and visible == _visible(_labels(sequence, None))
    return (*rows, *labels, *(("visible",) if follows else ()))


def _labels(
    sequence: AnnotatedSequence, size: tuple[int, int] | None
) -> dict[str, tuple[int, ...]]:
    """Values of the label files; those that are not published are taken from the other fields."""
    visible, cover = sequence.visible, sequence.cover
    absent: tuple[int, ...] | None = sequence.absent
    if visible is not None:
        absent = absent or tuple(1 - flag for flag in visible)
        cover = cover or tuple(_FULL_COVER * flag for flag in visible)
    cut = sequence.cut_by_image or _cut_by_image(sequence, size)
    found = {"absent": absent, "cover": cover, "cut_by_image": cut}
    return {name: values for name, values in found.items() if values is not None}


def _visible(labels: Mapping[str, tuple[int, ...]]) -> tuple[int, ...] | None:
    """Visibility as `nat2024.datasets.annotations.read_visible` takes it from label files."""
    if "cover" in labels:
        return tuple(int(level > 0) for level in labels["cover"])
    if "absent" in labels:
        return tuple(1 - flag for flag in labels["absent"])
    return None


def _cut_by_image(
    sequence: AnnotatedSequence, size: tuple[int, int] | None
) -> tuple[int, ...] | None:
    if size is None or sequence.boxes is None:
        return None
    x, y, w, h = all_boxes(sequence).T
    with np.errstate(over="ignore", invalid="ignore"):
        cut = (x < 0) | (y < 0) | (x + w > size[0]) | (y + h > size[1])
    return tuple(cut.astype(int).tolist())


def _meta(sequence: AnnotatedSequence, size: tuple[int, int] | None, fps: float | None) -> str:
    facts = {key: sequence.extra.get(f"got10k.{key}", "") for key in _EXTRA[:3]}
    facts[_FRAMES_PER_SECOND] = f"{fps:g}Hz" if fps else ""
    facts["object_class"] = sequence.category
    facts["motion_class"] = sequence.activity
    facts |= {key: sequence.extra.get(f"got10k.{key}", "") for key in _EXTRA[3:]}
    facts["resolution"] = f"({size[0]}, {size[1]})" if size else ""
    # a word that would not fit in a line is whole in the side file
    return f"[{_SECTION}]\n" + "".join(f"{k}: {' '.join(v.split())}\n" for k, v in facts.items())


def _read_native(folder: Path, sequence: KeptSequence) -> dict[str, Any]:
    found: dict[str, Any] = {}
    if "boxes" in sequence.native:
        found["boxes"] = rows_of(read_box_file(folder / "groundtruth.txt"))
    wanted = {n for n in LABELS if n in sequence.native or "visible" in sequence.native}
    present = [name for name in LABELS if name in wanted and is_stored(folder / LABELS[name])]
    labels = {n: read_labels(folder / LABELS[n], sequence.frames.count) for n in present}
    missing = [n for n in LABELS if n in sequence.native and n not in labels]
    if missing:
        msg = f"{folder / LABELS[missing[0]]}: no such file, but {sequence.name} has one"
        raise AnnotationInvalid(msg)
    return {**found, **labels, "visible": _visible(labels)}


def read_folder(folder: Path, files: tuple[str, ...], frames: int) -> dict[str, Any]:
    """What a sequence's folder of GOT-10k holds beside boxes, as fields of `AnnotatedSequence`.

    Args:
        folder: the sequence's folder.
        files: names of the files in it.
        frames: length of the sequence.

    Raises:
        DatasetIncomplete, BoxFileError: a label file of another length or with other values.
    """
    present = {name: folder / file for name, file in LABELS.items() if file in files}
    labels = {name: read_labels(path, frames) for name, path in present.items()}
    return {**labels, **read_meta(folder, files)}


def read_meta(folder: Path, files: tuple[str, ...]) -> dict[str, Any]:
    """Category, activity, fps, resolution and further facts of `meta_info.ini`, where it is."""
    if META_FILE not in files:
        return {}
    parser = configparser.ConfigParser(interpolation=None, strict=False)
    try:
        parser.read_string(read_bytes(folder / META_FILE).decode("utf-8-sig"))
    except (configparser.Error, UnicodeDecodeError) as error:
        msg = f"{folder / META_FILE}: cannot be read ({str(error).splitlines()[0]})"
        raise AnnotationInvalid(msg) from None
    meta = dict(parser[_SECTION]) if parser.has_section(_SECTION) else {}
    found: dict[str, Any] = {
        "category": meta.get("object_class", ""),
        "activity": meta.get("motion_class", ""),
        "extra": {f"got10k.{key}": meta[key] for key in _EXTRA if meta.get(key)},
        "fps": _number(meta.get(_FRAMES_PER_SECOND, ""), float),
        "resolution": _size(meta.get("resolution", "")),
    }
    return {key: value for key, value in found.items() if value}


def _number(text: str, kind: Callable[[str], Any]) -> Any:
    try:
        return kind(text.lower().removesuffix("hz"))
    except ValueError:
        return None


def _size(text: str) -> tuple[int, int] | None:
    parts = [_number(part.strip(), int) for part in text.strip("() ").split(",")]
    return (parts[0], parts[1]) if len(parts) == 2 and all(parts) else None
