"""Between the arrays of a sequence and the plain values of the annotation schema."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import numpy.typing as npt

from nat2024.datasets.file_names import find_pattern
from nat2024.datasets.frames import FolderFrames, StoredFrames
from nat2024.datasets.schema import AnnotatedSequence, Coordinate, FrameFiles, Row
from nat2024.datasets.video import VideoFrames
from nat2024.errors import AnnotationInvalid
from nat2024.types import Boxes, Flags

_NO_BOXES = np.empty((0, 4))
_FIELDS = tuple(field.name for field in msgspec.structs.fields(AnnotatedSequence))


def rows_of(boxes: Boxes) -> tuple[Row, ...]:
    """Rows of the schema for boxes, float64 (n, 4)."""
    rows = boxes.tolist()
    if not np.isfinite(boxes).all():
        rows = [[_coordinate(value) for value in row] for row in rows]
    return tuple(map(tuple, rows))


def _coordinate(value: float) -> Coordinate:
    if value != value:  # NaN
        return None
    if value in (float("inf"), float("-inf")):
        return "inf" if value > 0 else "-inf"
    return value


def boxes_of(rows: tuple[Row, ...] | None) -> Boxes:
    """Boxes, float64 (n, 4), of rows of the schema; (0, 4) for None."""
    if not rows:
        return _NO_BOXES
    plain = [[np.nan if value is None else float(value) for value in row] for row in rows]
    return np.array(plain, dtype=np.float64)


def all_boxes(sequence: AnnotatedSequence) -> Boxes:
    """One row a frame, NaN where only keyframes are annotated; (0, 4) without annotation."""
    rows = boxes_of(sequence.boxes)
    if sequence.keyframes is None or sequence.boxes is None:
        return rows
    boxes = np.full((sequence.frames.count, 4), np.nan)
    boxes[list(sequence.keyframes)] = rows
    return boxes


def keyframes_of(sequence: AnnotatedSequence) -> npt.NDArray[np.intp] | None:
    """Indices of the annotated frames, None where all are meant to be."""
    return None if sequence.keyframes is None else np.array(sequence.keyframes, dtype=np.intp)


def flags_of(values: tuple[int, ...] | None) -> Flags | None:
    """Flags as bool (n,)."""
    return None if values is None else np.array(values, dtype=np.bool_)


def annotated_rows(boxes: Boxes, keyframes: npt.NDArray[np.intp] | None) -> dict[str, Any]:
    """The fields `boxes` and `keyframes` for arrays with one row a frame."""
    if keyframes is None:
        return {"boxes": rows_of(boxes) if len(boxes) else None}
    return {"boxes": rows_of(boxes[keyframes]), "keyframes": tuple(keyframes.tolist())}


def frame_files(folder: str, names: tuple[str, ...]) -> FrameFiles:
    """The shortest description of these files; `folder` is relative."""
    found = find_pattern(names)
    if found is None:
        return FrameFiles(folder=folder, count=len(names), names=names)
    pattern, first = found
    return FrameFiles(folder=folder, count=len(names), pattern=pattern, first=first)


def stored_frames(base: Path, frames: FrameFiles) -> StoredFrames:
    """The images, or the video, of a sequence below the folder of an index."""
    folder = base / frames.folder if frames.folder else base
    if frames.video:
        return VideoFrames(folder / frames.video, frames.count)
    return FolderFrames(folder, frames.files())


def inner_folder(path: Path, base: Path) -> str:
    """The path of `path` from `base` with `/` between parts; empty where they are equal.

    Raises:
        AnnotationInvalid: it lies outside.
    """
    try:
        return path.relative_to(base).as_posix().removeprefix(".")
    except ValueError:
        msg = f"{path} lies outside of {base}, an index names only files inside its folder"
        raise AnnotationInvalid(msg) from None


def replace_fields(sequence: AnnotatedSequence, values: Mapping[str, Any]) -> AnnotatedSequence:
    """A plain `AnnotatedSequence` like this one with other values in some fields."""
    same = {name: getattr(sequence, name) for name in _FIELDS}
    return AnnotatedSequence(**{**same, **values})
