"""MATLAB files of version 5 to 7 before scipy sees them: unpacked, and well-formed to the byte.

scipy makes room for as many entries as a header claims, unpacks whatever it is given, and crashes
where counts do not fit or cells are nested without end. So only the variable `results` reaches it,
after all lengths, shapes and counts in it were seen to fit.
"""

import math
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import TypeAlias

from nat2024.errors import BoxFileError
from nat2024.importing.tree import MAX_BYTES

VARIABLE = b"results"

_HEADER = 128
_SIGNED, _UNSIGNED, _WORDS, _ARRAY, _PACKED = 5, 6, 1, 14, 15  # kinds of elements
_SIZES = {1: 1, 2: 1, 3: 2, 4: 2, 5: 4, 6: 4, 7: 4, 9: 8, 12: 8, 13: 8}  # bytes of a number
_TEXTS = (1, 2, 3, 4, 16, 17, 18)
_CELL, _STRUCT, _TEXT, _NUMBERS = 1, 2, 4, range(6, 16)  # classes of arrays
_COMPLEX = 0x0800
_MOST_ELEMENTS = 1024
_DEEPEST = 8

_Element: TypeAlias = tuple[int, bytes]


class _Malformed(Exception):
    """What is wrong with the bytes."""


def plain_elements(raw: bytes, path: Path) -> bytes:
    """The same file with the variable `results` alone, unpacked; one of version 7.3 as it is.

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
    try:
        return raw[:_HEADER] + b"".join(_results(raw, order))
    except (_Malformed, zlib.error) as error:
        msg = f"{path}: no MATLAB file, or a damaged one ({error})"
        raise BoxFileError(msg) from None


def _results(raw: bytes, order: str) -> Iterator[bytes]:
    """The variable `results` as one element, if it is there."""
    place, room, count = _HEADER, MAX_BYTES, 0
    while place + 8 <= len(raw):
        kind, length = struct.unpack_from(f"{order}II", raw, place)
        element = raw[place : place + 8 + length]
        place += 8 + length
        if kind == _PACKED:
            element = zlib.decompressobj().decompress(element[8:], room + 1)
        room, count = room - len(element), count + 1
        if room < 0 or count > _MOST_ELEMENTS:
            msg = f"it unpacks to more than {MAX_BYTES} bytes, too large for a result"
            raise _Malformed(msg)
        (found,) = [*_elements(element, order), (0, b"")][:1]
        if found[0] == _ARRAY and _name(found[1], order) == VARIABLE:
            _Checker(order).check(found[1])
            yield element
            return


def _elements(data: bytes, order: str) -> Iterator[_Element]:
    """Kinds and bytes of elements that lie one behind the other, each in its place."""
    place = 0
    while place < len(data):
        if place + 8 > len(data):
            msg = "an element is cut off"
            raise _Malformed(msg)
        kind, size = struct.unpack_from(f"{order}II", data, place)
        begin = place + 8
        end = begin + size + -size % 8
        if kind >> 16:  # up to four bytes stand where the size of others does
            kind, size, begin, end = kind & 0xFFFF, kind >> 16, place + 4, place + 8
        if begin + size > min(end, len(data)):
            msg = "an element is longer than what it lies in"
            raise _Malformed(msg)
        yield kind, data[begin : begin + size]
        place = end


def _name(array: bytes, order: str) -> bytes:
    """Name of an array; empty where it has none that can be read."""
    parts = list(_elements(array, order))[:3]
    return parts[2][1] if len(parts) == 3 else b""


class _Checker:
    """Sees that arrays hold what they say they hold, and counts them."""

    def __init__(self, order: str) -> None:
        self._order = order
        self._count = 0

    def check(self, array: bytes, depth: int = 0) -> None:
        """Raise `_Malformed` for an array that scipy must not see; an empty one is none."""
        self._count += 1
        if self._count > _MOST_ELEMENTS or depth > _DEEPEST:
            msg = f"more than {_MOST_ELEMENTS} arrays, or {_DEEPEST} in each other"
            raise _Malformed(msg)
        if not array:
            return
        parts = [*_elements(array, self._order), *[(0, b"")] * 3]
        flags, shape, name = parts[:3]
        if flags[0] != _UNSIGNED or len(flags[1]) != 8 or name[0] != _WORDS:
            msg = "an array without flags or name"
            raise _Malformed(msg)
        (flag,) = struct.unpack_from(f"{self._order}I", flags[1])
        entries = self._entries(shape, len(array))
        self._check_content(flag, entries, [one for one in parts[3:] if one[0]], depth)

    def _entries(self, shape: _Element, most: int) -> int:
        """How many entries an array of this shape has."""
        kind, raw = shape
        if kind != _SIGNED or len(raw) % 4 or not 8 <= len(raw) <= 128:
            msg = "an array without a shape"
            raise _Malformed(msg)
        sides: tuple[int, ...] = struct.unpack(f"{self._order}{len(raw) // 4}i", raw)
        count = math.prod(sides)
        if min(sides) < 0 or count > most:
            msg = f"an array is said to be {'x'.join(map(str, sides))}, and is not"
            raise _Malformed(msg)
        return count

    def _check_content(self, flag: int, entries: int, content: list[_Element], depth: int) -> None:
        kind = flag & 0xFF
        if kind in _NUMBERS:
            numbers = [_SIZES.get(one[0], 0) * entries == len(one[1]) for one in content]
            fits = len(content) == (2 if flag & _COMPLEX else 1) and all(numbers)
            fits = fits and all(one[0] in _SIZES for one in content)
        elif kind == _TEXT:
            fits = len(content) == 1 and content[0][0] in _TEXTS
        elif kind in (_CELL, _STRUCT):
            if kind == _STRUCT:
                entries, content = entries * self._fields(content[:2]), content[2:]
            fits = len(content) == entries and all(one[0] == _ARRAY for one in content)
            for one in content if fits else ():
                self.check(one[1], depth + 1)
        else:
            fits = False
        if not fits:
            msg = f"an array of class {kind} that does not hold its {entries} entries"
            raise _Malformed(msg)

    def _fields(self, content: list[_Element]) -> int:
        """How many fields a struct has."""
        if [one[0] for one in content] != [_SIGNED, _WORDS] or len(content[0][1]) != 4:
            msg = "a struct without names of its fields"
            raise _Malformed(msg)
        length = int.from_bytes(content[0][1], "little" if self._order == "<" else "big")
        names = content[1][1]
        if not 0 < length <= 64 or len(names) % length or not names:
            msg = "a struct with damaged names of its fields"
            raise _Malformed(msg)
        return len(names) // length
