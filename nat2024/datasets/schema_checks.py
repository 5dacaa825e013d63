"""What the types of the annotation schema cannot say: counts that fit, names that stay inside."""

import itertools
import math
import re
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TypeVar

import msgspec

from nat2024.datasets.file_names import is_inner_path, is_plain_name
from nat2024.datasets.schema import (
    AnnotatedDataset,
    AnnotatedSequence,
    FrameFiles,
    decode_dataset,
    read_bytes,
)
from nat2024.errors import AnnotationInvalid

_CHECKSUM = re.compile(r"[0-9a-f]{64}")
_COUNT = 1_000_000  # nine hours of video
_FULL_COVER = 8

_Dataset = TypeVar("_Dataset", bound=AnnotatedDataset)


def check_dataset(document: _Dataset, where: str, *, complete: bool = True) -> _Dataset:
    """The same document with its sequences sorted by name, if all in it fits together.

    Args:
        document: what was read.
        where: named in errors.
        complete: boxes are there for every keyframe, as in an index file; a side file leaves
            them to the files of its format.

    Raises:
        AnnotationInvalid: the first thing that does not fit, in one line.
    """
    for fault in itertools.chain(_faults(document), _sequence_faults(document, complete)):
        msg = f"{where}: {fault}"
        raise AnnotationInvalid(msg)
    ordered = tuple(sorted(document.sequences, key=lambda sequence: sequence.name))
    return msgspec.structs.replace(document, sequences=ordered)


def read_dataset(path: Path) -> AnnotatedDataset:
    """Read and check an index file.

    Raises:
        AnnotationInvalid: it cannot be read; see `decode_dataset`.
    """
    document = decode_dataset(read_bytes(path), str(path))
    return check_dataset(document, str(path))


def _faults(document: AnnotatedDataset) -> Iterator[str]:
    if not is_plain_name(document.name):
        yield f"{document.name!r} cannot be the name of a dataset: it must be a plain file name"
    yield from _twice("attributes", (term.name for term in document.attributes))
    yield from _twice("sequences", (sequence.name for sequence in document.sequences))
    yield from _numbers("dataset", document.fps, document.resolution)
    if any(not term.name or not term.name.isprintable() for term in document.attributes):
        yield "an attribute has no printable name"


def _sequence_faults(document: AnnotatedDataset, complete: bool) -> Iterator[str]:
    known = set(document.attribute_names)
    for sequence in document.sequences:
        if not is_plain_name(sequence.name):
            yield f"{sequence.name!r} cannot be the name of a sequence: no plain file name"
        where = f"sequence {sequence.name}"
        yield from (f"{where}: {fault}" for fault in _frame_faults(sequence.frames))
        yield from (f"{where}: {fault}" for fault in _count_faults(sequence, complete))
        yield from _numbers(where, sequence.fps, sequence.resolution)
        for name in sorted(sequence.attributes.keys() - known):
            yield f"{where}: attribute {name!r} is not among the dataset's attributes"


def _frame_faults(frames: FrameFiles) -> Iterator[str]:
    if not is_inner_path(frames.folder):
        yield f"frames.folder {frames.folder!r} leads out of the dataset, or is no plain path"
    if not 0 < frames.count <= _COUNT:
        yield f"frames.count {frames.count}: expected 1 to {_COUNT}"
        return
    if sum(map(bool, (frames.names, frames.pattern, frames.video))) != 1:
        yield "frames: expected one of names, pattern and video"
    if frames.first < 0:
        yield f"frames.first {frames.first} is negative"
    try:
        names = frames.files()
    except AnnotationInvalid as error:
        yield f"frames: {error}"
        return
    yield from _file_faults(frames, names)


def _file_faults(frames: FrameFiles, names: tuple[str, ...]) -> Iterator[str]:
    strange = next((name for name in names if not is_plain_name(name)), None)
    if strange is not None:
        yield f"frame {strange!r} leads out of its folder, or is no plain file name"
    yield from _twice("frames", names)
    if not frames.video and len(names) != frames.count:
        yield f"{len(names)} names, but {frames.count} frames"
    for field, values in {"sizes": frames.sizes, "sha256": frames.sha256}.items():
        if values and len(values) != len(names):
            yield f"{len(values)} {field}, but {len(names)} files"
    if any(size < 0 for size in frames.sizes) or not all(map(_CHECKSUM.fullmatch, frames.sha256)):
        yield "frames: a size is negative, or a checksum is not 64 hexadecimal digits"


def _count_faults(sequence: AnnotatedSequence, complete: bool) -> Iterator[str]:
    frames = sequence.frames.count
    rows = frames
    keyframes = sequence.keyframes
    if keyframes is not None:
        rows = len(keyframes)
        rising = all(a < b for a, b in itertools.pairwise(keyframes))
        if not keyframes or not rising or keyframes[0] < 0 or keyframes[-1] >= frames:
            yield f"keyframes: expected rising indices from 0 to {frames - 1}"
    if sequence.boxes is not None and len(sequence.boxes) != rows:
        what = "frames" if keyframes is None else "keyframes"
        yield f"{len(sequence.boxes)} boxes, but {rows} {what}"
    if complete and keyframes is not None and sequence.boxes is None:
        yield "keyframes without boxes"
    for field in ("visible", "absent", "cover", "cut_by_image"):
        values = getattr(sequence, field)
        if values is not None and len(values) != frames:
            yield f"{len(values)} values of {field}, but {frames} frames"
        highest = _FULL_COVER if field == "cover" else 1
        if any(not 0 <= value <= highest for value in values or ()):
            yield f"{field}: expected whole numbers from 0 to {highest}"


def _numbers(where: str, fps: float | None, size: tuple[int, int] | None) -> Iterator[str]:
    if fps is not None and not (math.isfinite(fps) and fps > 0):
        yield f"{where}: fps {fps}: expected a number above 0"
    if size is not None and min(size) < 1:
        yield f"{where}: resolution {size[0]}x{size[1]}: expected numbers above 0"


def _twice(what: str, names: Iterable[str]) -> Iterator[str]:
    name, count = next(iter(Counter(names).most_common(1)), ("", 0))
    if count > 1:
        yield f"{what}: {name!r} comes {count} times, names must differ"
