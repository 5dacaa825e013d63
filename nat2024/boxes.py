"""Text files of boxes: every variant that published annotations and results come in.

One row a frame. Fields are separated by commas, semicolons, tabs, blanks or mixtures of them;
CRLF line ends, a byte-order mark, comment lines (`#`), trailing separators and trailing blank
lines are accepted. A row has 4 fields (x, y, w, h), 5 (the fifth a score) or 8 (a polygon of
four corners, which becomes its bounding box). `NaN` in any case marks an absent target.
"""

import codecs
import math
import os
import re
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import numpy.typing as npt

from nat2024.errors import ArrayContract, BoxFileError
from nat2024.files import write_atomic
from nat2024.types import Boxes, Floats

_SEPARATORS = re.compile(r"\s*[,;]\s*|\s+")
_ROW_LENGTHS = (4, 5, 8)

_NEWLINE, _PLUS, _COMMA, _MINUS = b"\n+,-"
_IRREGULAR = b"\0"
_DECIMAL = b".eENna+"
_INTEGER_WIDTH = 18  # digits and sign that int64 surely holds
_SHORT_WIDTH = 4  # digits that two pairs of bytes hold
_ZERO, _TEN, _LAST_DIGIT = np.uint8(48), np.uint8(10), np.uint8(57)
_HUNDRED = np.uint16(100)


def _regular_table() -> bytes:
    """Separators within a line as commas; what plain numbers do not hold as `_IRREGULAR`."""
    table = bytearray(256)
    for code in b"0123456789-\n" + _DECIMAL:
        table[code] = code
    for code in b",; \t":
        table[code] = _COMMA
    return bytes(table)


_REGULAR = _regular_table()
_NUMBERS: Any = msgspec.json.Decoder(list[float])
_NUMBERS_OR_NULL: Any = msgspec.json.Decoder(list[float | None])


def read_boxes(path: str | os.PathLike[str]) -> Boxes:
    """Read a text file of boxes.

    Returns:
        float64 (n, 4) of x, y, w, h in pixels. Scores are dropped, polygons become their
        bounding boxes, NaN and infinite values are kept as they are.

    Raises:
        BoxFileError: the file is absent, empty, no text, or a row cannot be read; names file
            and line.
    """
    return parse_boxes(read_text(path), source=str(path))


def read_text(path: str | os.PathLike[str]) -> bytes:
    """The bytes of a text file of boxes.

    Raises:
        BoxFileError: the file is absent or cannot be read.
    """
    path = Path(path)
    try:
        return path.read_bytes()
    except FileNotFoundError:
        msg = f"{path}: no such file of boxes"
        raise BoxFileError(msg) from None
    except OSError as error:
        msg = f"{path}: cannot be read ({error.strerror})"
        raise BoxFileError(msg) from None


def parse_boxes(text: str | bytes, source: str = "<text>") -> Boxes:
    """Parse the text (or its UTF-8 bytes) of a box file; see `read_boxes`.

    `source` is named in errors.
    """
    rows = parse_rows(text, source, _ROW_LENGTHS)
    if not len(rows):
        msg = f"{source}: no boxes in it; expected one row x,y,w,h a frame"
        raise BoxFileError(msg)
    return _corners_to_boxes(rows) if rows.shape[1] == 8 else np.ascontiguousarray(rows[:, :4])


def parse_rows(text: str | bytes, source: str, lengths: tuple[int, ...]) -> Floats:
    """Parse rows of numbers, all of one of the allowed `lengths`, into float64 (n, length).

    Every number is the float64 nearest to its text. Regular text takes a fast path with the same
    result; all else is read line by line.
    """
    raw = text.encode("utf-8", "surrogatepass") if isinstance(text, str) else text
    rows = _parse_regular(raw, lengths)
    if rows is not None:
        return rows
    return _parse_lines(_decode(raw, source) if isinstance(text, bytes) else text, source, lengths)


def _decode(raw: bytes, source: str) -> str:
    try:
        return raw.decode("utf-8")
    except UnicodeDecodeError as error:
        msg = f"{source}: not a text file of boxes (byte {error.start} is no UTF-8)"
        raise BoxFileError(msg) from None


def _parse_regular(raw: bytes, lengths: tuple[int, ...]) -> Floats | None:
    """Rows of text in which single separators part plain numbers; None for any other text."""
    body = raw.removeprefix(codecs.BOM_UTF8).rstrip(b" \t\r\n")
    if b"\r" in body:
        body = body.replace(b"\r\n", b"\n")
    if b" " in body:
        body = body.replace(b", ", b",")
    # both ends padded so that every number lies between two separators
    lines = b"\n" + body + b"\n"
    plain = _parse_plain(lines, lengths)
    if plain is not None:
        return plain
    lines = lines.translate(_REGULAR)
    if _IRREGULAR in lines:
        return None
    codes = np.frombuffer(lines, dtype=np.uint8)
    is_separator = codes <= _COMMA
    if b"+" in lines:
        is_separator &= codes != _PLUS
    separators = np.flatnonzero(is_separator)
    widths = np.diff(separators)
    ends = codes[separators[1:]] == _NEWLINE
    width = int(np.argmax(ends)) + 1
    if width not in lengths or len(ends) % width or widths.min() < 2:
        return None
    ends = ends.reshape(-1, width)
    if not ends[:, -1].all() or np.count_nonzero(ends) != len(ends):
        return None
    numbers = lines[1:].replace(b"\n", b",")[:-1]
    if any(code in numbers for code in _DECIMAL):
        values = _parse_decimals(numbers)
    else:
        values = _parse_integers(numbers, codes[separators[:-1] + 1], widths - 1)
    return None if values is None else values.reshape(-1, width)


def _parse_plain(lines: bytes, lengths: tuple[int, ...]) -> Floats | None:
    """Rows of digits, points and minus signs, all parted alike; None for any other text.

    Nearly all boxes are written so. Args as `_parse_regular`, with a line end on both sides.
    """
    codes = np.frombuffer(lines, dtype=np.uint8)
    if b"/" in lines or codes.max() > _LAST_DIGIT:
        return None
    edges = np.flatnonzero(codes <= _COMMA)
    separators = codes.take(edges[1:]).tobytes()
    width = _common_width(separators)
    if width not in lengths:
        return None
    digits = edges[1:] - edges[:-1]
    digits -= 1
    if digits.min() < 1:
        return None
    if b"." in lines:
        numbers = lines[1:-1]
        for separator in {*separators[:width]} - {_COMMA}:
            numbers = numbers.replace(bytes([separator]), b",")
        values = _parse_decimals(numbers)
    else:
        values = _parse_short_integers(lines, codes, edges, digits)
    return None if values is None else values.reshape(-1, width)


def _parse_short_integers(
    lines: bytes,
    codes: npt.NDArray[np.uint8],
    edges: npt.NDArray[np.intp],
    digits: npt.NDArray[np.intp],
) -> Floats | None:
    """Whole numbers of at most four digits between `edges`; None for others.

    Every step goes over all bytes at once, and no number is looked at by itself.
    """
    signed = codes.take(edges[:-1] + 1) == _MINUS if b"-" in lines else None
    if signed is not None:
        digits -= signed
        if lines.count(b"-") != np.count_nonzero(signed) or digits.min() < 1:
            return None
    if digits.max() > _SHORT_WIDTH:
        return None
    values = _whole_numbers(codes).take(edges[1:] - 1).astype(np.float64)
    if signed is not None:
        values[signed] *= -1.0  # a negative zero keeps its sign
    return values


def _common_width(separators: bytes) -> int:
    """How many numbers each line has, by what follows each number; 0 where lines differ."""
    width = separators.find(b"\n") + 1
    row = separators[:width]
    if width == 0 or row[:-1].strip(b", \t") or row * (len(separators) // width) != separators:
        return 0
    return width


def _whole_numbers(codes: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint16]:
    """At each byte the number of the last digits up to there, at most four.

    Minus signs count as separators; all else is a digit or one.
    """
    is_digit = (codes >= _ZERO).view(np.uint8)
    pairs = codes - _ZERO
    pairs *= is_digit
    tens = pairs * _TEN
    pairs[1:] += tens[:-1]
    pairs *= is_digit
    numbers = pairs.astype(np.uint16)
    numbers[2:] += (pairs[:-2] * is_digit[1:-1]) * _HUNDRED
    return numbers


def _parse_integers(
    numbers: bytes, first: npt.NDArray[np.uint8], widths: npt.NDArray[np.intp]
) -> Floats | None:
    """Numbers of digits and minus signs, of which `first` holds the first characters."""
    if b"-" in numbers:
        if b"-0" in numbers:  # int64 has no negative zero
            return None
        signed = first == _MINUS
        if numbers.count(b"-") != np.count_nonzero(signed) or (widths[signed] < 2).any():
            return None
    if widths.max() > _INTEGER_WIDTH:
        return _parse_decimals(numbers)
    return np.fromstring(numbers, dtype=np.int64, sep=",").astype(np.float64)


def _parse_decimals(numbers: bytes) -> Floats | None:
    """Numbers in the grammar of JSON, and NaN; None where one is in no such form."""
    # the decoder drops the sign of an integer zero
    if b"-" in numbers and (b"-0," in numbers or numbers.endswith(b"-0")):
        return None
    decoder = _NUMBERS
    if b"N" in numbers or b"n" in numbers:
        # `null` becomes NaN in the array; no text that got here has a "u" of its own
        numbers = numbers.replace(b"NaN", b"null").replace(b"nan", b"null")
        decoder = _NUMBERS_OR_NULL
    try:
        return np.array(decoder.decode(b"[" + numbers + b"]"), dtype=np.float64)
    except msgspec.DecodeError:
        return None


def _parse_lines(text: str, source: str, lengths: tuple[int, ...]) -> Floats:
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
    return np.array(rows, dtype=np.float64).reshape(len(rows), len(rows[0]) if rows else lengths[0])


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
        return [_number(text) for text in fields]
    except ValueError:
        msg = f"{where}: {_shorten(line)!r} is not a row of numbers"
        raise BoxFileError(msg) from None


def _number(text: str) -> float:
    # float() also takes 1_000 and digits of other scripts, which no writer of boxes means
    if "_" in text or not text.isascii():
        raise ValueError(text)
    return float(text)


def _shorten(line: str, limit: int = 60) -> str:
    line = line.strip()
    return line if len(line) <= limit else line[: limit - 3] + "..."


def _corners_to_boxes(corners: Floats) -> Boxes:
    x, y = corners[:, 0::2], corners[:, 1::2]
    left, top = x.min(axis=1), y.min(axis=1)
    return np.stack([left, top, x.max(axis=1) - left, y.max(axis=1) - top], axis=1)


def format_boxes(boxes: Boxes) -> str:
    """Text of boxes, one `x,y,w,h` a line: the shortest that reads back to the same float64."""
    try:
        boxes = np.asarray(boxes, dtype=np.float64)
    except (TypeError, ValueError):
        msg = "boxes must be numbers of the shape (n, 4)"
        raise ArrayContract(msg) from None
    if boxes.ndim != 2 or boxes.shape[1] != 4 or not len(boxes):
        msg = f"boxes must have the shape (n, 4) with n of at least 1, not {boxes.shape}"
        raise ArrayContract(msg)
    return "".join(",".join(map(_shortest, row)) + "\n" for row in boxes.tolist())


def _shortest(value: float) -> str:
    if math.isnan(value):
        return "NaN"
    text = repr(value)
    # a whole number without its point, but a negative zero keeps it: "-0" is read as an integer
    if abs(value) < 1e18 and value.is_integer() and text != "-0.0":
        return min(str(int(value)), text, key=len)
    return text


def write_boxes(path: str | os.PathLike[str], boxes: Boxes) -> None:
    """Write boxes, float64 (n, 4), atomically; `read_boxes` gives back equal numbers.

    Raises:
        ArrayContract: `boxes` has another shape.
    """
    write_atomic(path, format_boxes(boxes))
