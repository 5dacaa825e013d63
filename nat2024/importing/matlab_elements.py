"""MATLAB files of version 5 to 7 before scipy sees them: unpacked, and of plausible sizes.

scipy makes room for as many entries as a header claims, unpacks whatever it is given, and crashes
on cells nested without end, so that a file of some kilobytes could take all memory.
"""

import math
import struct
import zlib
from pathlib import Path

from nat2024.errors import BoxFileError
from nat2024.importing.tree import MAX_BYTES

_HEADER = 128
_ARRAY, _PACKED = 14, 15  # kinds of elements
_WHOLE_NUMBERS = (5, 6)  # kinds that a shape may be written in
_BEFORE_SHAPE = 24  # bytes from the beginning of an array
_MOST_ELEMENTS = 1024


def plain_elements(raw: bytes, path: Path) -> bytes:
    """The same file with its elements unpacked; one of version 7.3 as it is.

    Raises:
        BoxFileError: no such file, or one that claims, nests or unpacks to more than the result of
            a tracker ever does.
    """
    order = {b"IM": "<", b"MI": ">"}.get(raw[_HEADER - 2 : _HEADER])
    if order is None:
        msg = f"{path}: no MATLAB file of version 5 to 7"
        raise BoxFileError(msg)
    if raw[124:126] in (b"\0\2", b"\2\0"):  # 7.3, which is HDF5
        return raw
    parts, place, size = [raw[:_HEADER]], _HEADER, _HEADER
    while place + 8 <= len(raw):
        kind, length = struct.unpack_from(f"{order}II", raw, place)
        element = raw[place : place + 8 + length]
        if kind == _PACKED:
            element = _unpack(element[8:], MAX_BYTES - size, path)
        parts.append(element)
        size += len(element)
        place += 8 + length
        if size > MAX_BYTES or len(parts) > _MOST_ELEMENTS:
            msg = f"{path}: unpacks to more than {MAX_BYTES} bytes, too large for a result file"
            raise BoxFileError(msg)
    plain = b"".join(parts)
    _check_arrays(plain, order, path)
    return plain


def _unpack(packed: bytes, room: int, path: Path) -> bytes:
    """At most one byte more than there is room for."""
    try:
        return zlib.decompressobj().decompress(packed, max(1, room + 1))
    except zlib.error as error:
        msg = f"{path}: no MATLAB file, or a damaged one ({error})"
        raise BoxFileError(msg) from None


def _check_arrays(plain: bytes, order: str, path: Path) -> None:
    """Raise `BoxFileError` for more arrays, or more entries in one, than there can be.

    Arrays lie in arrays, and lengths may lie about where, so all places that look like one count.
    """
    tag = struct.pack(f"{order}I", _ARRAY)
    if plain.count(tag) > _MOST_ELEMENTS:
        msg = f"{path}: more than {_MOST_ELEMENTS} arrays, which is no result of a tracker"
        raise BoxFileError(msg)
    place = plain.find(tag, _HEADER)
    while place >= 0:
        shape = _shape(plain, place + _BEFORE_SHAPE, order)
        if math.prod(map(abs, shape)) > len(plain):
            msg = f"{path}: an array in it is said to be {'x'.join(map(str, shape))}, and is not"
            raise BoxFileError(msg)
        place = plain.find(tag, place + 1)


def _shape(plain: bytes, place: int, order: str) -> tuple[int, ...]:
    """The shape that stands at a place; empty where none does."""
    if place + 8 > len(plain):
        return ()
    kind, size = struct.unpack_from(f"{order}II", plain, place)
    begin = place + 8
    if kind >> 16:  # up to four bytes stand where the size of others does
        kind, size, begin = kind & 0xFFFF, kind >> 16, place + 4
    if kind not in _WHOLE_NUMBERS or size > 128:
        return ()
    numbers = plain[begin : begin + size // 4 * 4]
    return struct.unpack(f"{order}{len(numbers) // 4}i", numbers[: len(numbers) // 4 * 4])
