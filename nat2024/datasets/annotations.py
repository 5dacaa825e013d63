"""The text files beside the frames: boxes of all frames, boxes of some, flags, attributes."""

import re
from pathlib import Path

import numpy as np
import numpy.typing as npt

from nat2024.archives import read_bytes
from nat2024.boxes import parse_boxes, parse_rows
from nat2024.errors import BoxFileError, DatasetIncomplete
from nat2024.types import Boxes, Flags

_SEPARATORS = re.compile(r"[,;\s]+")
_LASOT_ABSENT = ("full_occlusion.txt", "out_of_view.txt")


def read_keyframes(path: Path, frames: int) -> tuple[Boxes, npt.NDArray[np.intp]]:
    """Read boxes of some frames: rows `frame,x,y,w,h`, `frame` counted from 1.

    Args:
        path: the file; lines that begin with `#` are comments.
        frames: length of the sequence.

    Returns:
        float64 (frames, 4) with NaN where there is no row, and the sorted 0-based indices of the
        annotated frames.

    Raises:
        BoxFileError: unreadable, or a frame number is no whole number in 1..frames or comes
            twice; names the file.
    """
    rows = parse_rows(_read_text(path), str(path), (5,))
    if not len(rows):
        msg = f"{path}: no boxes in it; expected rows frame,x,y,w,h"
        raise BoxFileError(msg)
    numbers = rows[:, 0]
    wrong = [n for n in numbers.tolist() if not (1 <= n <= frames and n == int(n))]
    if wrong:
        msg = f"{path}: frame {wrong[0]:g} is none of the {frames} frames, counted from 1"
        raise BoxFileError(msg)
    order = np.argsort(numbers, kind="stable")
    keyframes = numbers[order].astype(np.intp) - 1
    twice = keyframes[1:][keyframes[1:] == keyframes[:-1]]
    if len(twice):
        msg = f"{path}: frame {int(twice[0]) + 1} has two boxes"
        raise BoxFileError(msg)
    boxes = np.full((frames, 4), np.nan)
    boxes[keyframes] = rows[order, 1:]
    return boxes, keyframes


def read_box_file(path: Path) -> Boxes:
    """Boxes as `nat2024.read_boxes`, of a file in a folder or an archive.

    Raises:
        BoxFileError: it cannot be read; names file and line.
    """
    return parse_boxes(read_side_file(path), str(path))


def read_visible(folder: Path, files: tuple[str, ...], frames: int) -> Flags | None:
    """Visibility flags as GOT-10k and LaSOT publish them in a sequence's folder.

    Args:
        folder: the sequence's folder.
        files: names of the files in it.
        frames: length of the sequence.

    Returns:
        bool (frames,): GOT-10k `cover.label` above 0 (else `absence.label` 0); LaSOT neither
        `full_occlusion.txt` nor `out_of_view.txt` 1. None where there is no such file.

    Raises:
        DatasetIncomplete: the number of flags is not the number of frames.
        BoxFileError: a file is no list of whole numbers.
    """
    visible: Flags | None = None
    if "cover.label" in files:
        visible = _read_flags(folder / "cover.label", frames) > 0
    elif "absence.label" in files:
        visible = _read_flags(folder / "absence.label", frames) == 0
    else:
        absent = [_read_flags(folder / name, frames) for name in _LASOT_ABSENT if name in files]
        visible = ~np.any(absent, axis=0) if absent else None
    return visible


def read_labels(path: Path, frames: int) -> tuple[int, ...]:
    """Whole numbers of a `*.label` file of GOT-10k, one a frame.

    Raises:
        DatasetIncomplete: the number of values is not the number of frames.
        BoxFileError: the file is no list of whole numbers.
    """
    return tuple(_read_flags(path, frames).tolist())


def read_attributes(path: Path, columns: tuple[str, ...]) -> frozenset[str]:
    """Attributes whose column in `att/NAME.txt` is 1.

    Args:
        path: file of 0/1 separated by commas, blanks or line ends.
        columns: abbreviations in the order of the columns.

    Raises:
        BoxFileError: another number of columns, or other values than 0 and 1.
    """
    fields = _fields(path)
    if len(fields) != len(columns):
        msg = f"{path}: {len(fields)} columns, expected {len(columns)} ({', '.join(columns)})"
        raise BoxFileError(msg)
    try:
        values = [float(field) for field in fields]
    except ValueError:
        values = [np.nan]
    if not {0.0, 1.0}.issuperset(values):
        msg = f"{path}: expected a row of 0 and 1, one a column"
        raise BoxFileError(msg)
    return frozenset(c for c, value in zip(columns, values, strict=True) if value == 1)


def _read_flags(path: Path, frames: int) -> npt.NDArray[np.int64]:
    try:
        flags = np.array([int(field) for field in _fields(path)], dtype=np.int64)
    except (ValueError, OverflowError):
        msg = f"{path}: expected one whole number a frame"
        raise BoxFileError(msg) from None
    if len(flags) != frames:
        msg = f"{path}: {len(flags)} flags, but {frames} images"
        raise DatasetIncomplete(msg)
    return flags


def _fields(path: Path) -> list[str]:
    return [field for field in _SEPARATORS.split(_read_text(path)) if field]


def read_side_file(path: Path) -> bytes:
    """The bytes of a text file, in a folder or an archive.

    Raises:
        BoxFileError: it cannot be read.
    """
    try:
        return read_bytes(path)
    except OSError as error:
        msg = f"{path}: cannot be read ({error.strerror})"
        raise BoxFileError(msg) from None


def _read_text(path: Path) -> str:
    try:
        return read_side_file(path).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        msg = f"{path}: no text file (byte {error.start} is no UTF-8)"
        raise BoxFileError(msg) from None
