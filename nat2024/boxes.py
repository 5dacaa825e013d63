"""Text files of boxes: every variant that published annotations and results come in.

One row a frame. Fields are separated by commas, semicolons, tabs, blanks or mixtures of them;
CRLF line ends, a byte-order mark, comment lines (`#`), trailing separators and trailing blank
lines are accepted. A row has 4 fields (x, y, w, h), 5 (the fifth a score) or 8 (a polygon of
four corners, which becomes its bounding box). `NaN` in any case marks an absent target.
"""

import math
import os
import re
from pathlib import Path

import numpy as np

from nat2024.errors import ArrayContract, BoxFileError
from nat2024.files import write_atomic
from nat2024.types import Boxes, Floats

_SEPARATORS = re.compile(r"[,;\s]+")
_ROW_LENGTHS = (4, 5, 8)


def read_boxes(path: str | os.PathLike[str]) -> Boxes:
    """Read a text file of boxes.

    Returns:
        float64 (n, 4) of x, y, w, h in pixels. Scores are dropped, polygons become their
        bounding boxes, NaN and infinite values are kept as they are.

    Raises:
        BoxFileError: the file is absent, empty, no text, or a row cannot be read; names file
            and line.
    """
    path = Path(path)
    try:
        text = path.read_bytes().decode("utf-8-sig")
    except FileNotFoundError:
        msg = f"{path}: no such file of boxes"
        raise BoxFileError(msg) from None
    except OSError as error:
        msg = f"{path}: cannot be read ({error.strerror})"
        raise BoxFileError(msg) from None
    except UnicodeDecodeError as error:
        msg = f"{path}: not a text file of boxes (byte {error.start} is no UTF-8)"
        raise BoxFileError(msg) from None
    return parse_boxes(text, source=str(path))


def parse_boxes(text: str, source: str = "<text>") -> Boxes:
    """Parse the text of a box file; see `read_boxes`. `source` is named in errors."""
    rows = parse_rows(text, source, _ROW_LENGTHS)
    if not len(rows):
        msg = f"{source}: no boxes in it; expected one row x,y,w,h a frame"
        raise BoxFileError(msg)
    return _corners_to_boxes(rows) if rows.shape[1] == 8 else np.ascontiguousarray(rows[:, :4])


def parse_rows(text: str, source: str, lengths: tuple[int, ...]) -> Floats:
    """Parse rows of numbers, all of one of the allowed `lengths`, into float64 (n, length)."""
    lines = text.removeprefix("\ufeff").splitlines()
    while lines and not lines[-1].strip():
        lines.pop()
    rows: list[list[float]] = []
    for number, line in enumerate(lines, 1):
        if line.lstrip().startswith("#"):
            continue
        rows.append(_parse_line(line, f"{source}, line {number}", lengths))
        if len(rows[-1]) != len(rows[0]):
            msg = (
                f"{source}, line {number}: {len(rows[-1])} fields, "
                f"but the first row has {len(rows[0])}"
            )
            raise BoxFileError(msg)
    return np.array(rows, dtype=np.float64).reshape(len(rows), len(rows[0]) if rows else 4)


def _parse_line(line: str, where: str, lengths: tuple[int, ...]) -> list[float]:
    fields = _SEPARATORS.split(line.strip(" \t\r\n,;"))
    if fields == [""]:
        msg = f"{where}: blank line between rows; write NaN,NaN,NaN,NaN for an absent target"
        raise BoxFileError(msg)
    if len(fields) not in lengths:
        wanted = " or ".join(map(str, lengths))
        msg = f"{where}: {len(fields)} fields in {_shorten(line)!r}, expected {wanted}"
        raise BoxFileError(msg)
    try:
        return [float(text) for text in fields]
    except ValueError:
        msg = f"{where}: {_shorten(line)!r} is not a row of numbers"
        raise BoxFileError(msg) from None


def _shorten(line: str, limit: int = 60) -> str:
    line = line.strip()
    return line if len(line) <= limit else line[: limit - 3] + "..."


def _corners_to_boxes(corners: Floats) -> Boxes:
    x, y = corners[:, 0::2], corners[:, 1::2]
    left, top = x.min(axis=1), y.min(axis=1)
    return np.stack([left, top, x.max(axis=1) - left, y.max(axis=1) - top], axis=1)


def format_boxes(boxes: Boxes) -> str:
    """Text of boxes, one `x,y,w,h` a line: the shortest that reads back to the same float64."""
    boxes = np.asarray(boxes, dtype=np.float64)
    if boxes.ndim != 2 or boxes.shape[1] != 4:
        msg = f"boxes must have the shape (n, 4), not {boxes.shape}"
        raise ArrayContract(msg)
    return "".join(",".join(map(_shortest, row)) + "\n" for row in boxes.tolist())


def _shortest(value: float) -> str:
    if math.isfinite(value) and value == int(value) and abs(value) < 1e15:
        return "-0.0" if value == 0 and math.copysign(1, value) < 0 else str(int(value))
    return "NaN" if math.isnan(value) else repr(value)


def write_boxes(path: str | os.PathLike[str], boxes: Boxes) -> None:
    """Write boxes, float64 (n, 4), atomically; `read_boxes` gives back equal numbers.

    Raises:
        ArrayContract: `boxes` has another shape.
    """
    write_atomic(path, format_boxes(boxes))
