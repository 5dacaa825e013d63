"""Reading TensorFlow checkpoints (format V2, "tensor bundles") without TensorFlow.

A checkpoint is a prefix with two kinds of files: `PREFIX.index`, a LevelDB table that maps names to
protocol buffers (type, shape and place of a tensor), and `PREFIX.data-00000-of-00001`, the bytes
of the tensors. Nothing in them is code. Lengths and places are checked against the size of the
files before anything is read, and checksums (masked crc32c) before anything is believed.
"""

import math
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from nat2024.errors import WeightsMismatch, WeightsMissing

Arrays: TypeAlias = dict[str, npt.NDArray[Any]]

_MAGIC = 0xDB4775248B80FB57
_FOOTER = 48
_LARGEST_INDEX = 1 << 26  # bytes; real ones have some kilobytes
_MOST_ENTRIES = 1 << 16
_TYPES = {1: "<f4", 2: "<f8", 3: "<i4", 9: "<i8", 10: "?", 19: "<f2"}  # numbers of DataType
_LANES = 4096


class _Malformed(Exception):
    """What is wrong with the bytes."""


def read_tensorflow(prefix: str | Path) -> Arrays:
    """All numeric tensors of a checkpoint by the names of their variables, in their own layout.

    Args:
        prefix: the path without `.index`, or that of the `.index` file.

    Raises:
        WeightsMissing: there is no `.index` file or a data file is absent.
        WeightsMismatch: a file is damaged, cut off or of another format; says how.
    """
    prefix = Path(str(prefix).removesuffix(".index"))
    index = prefix.with_name(prefix.name + ".index")
    if not index.is_file():
        msg = f"{index}: no such file; a TensorFlow checkpoint is a pair of .index and .data files"
        raise WeightsMissing(msg)
    try:
        if index.stat().st_size > _LARGEST_INDEX:
            msg = "it is too large for an index"
            raise _Malformed(msg)
        return dict(_tensors(prefix, index.read_bytes()))
    except _Malformed as error:
        msg = f"{index}: not a readable TensorFlow checkpoint ({error})"
        raise WeightsMismatch(msg) from None
    except OSError as error:
        msg = f"{index}: not readable ({error.strerror or error})"
        raise WeightsMismatch(msg) from None


def _tensors(prefix: Path, table: bytes) -> Iterator[tuple[str, npt.NDArray[Any]]]:
    entries = dict(_read_table(table))
    header = dict(_fields(entries.pop(b"", b"")))
    shards = _number(header.get(1, 0))
    if not 1 <= shards <= 1024 or _number(header.get(2, 0)) != 0:
        msg = "its header is missing, or its numbers are big-endian"
        raise _Malformed(msg)
    for key, value in entries.items():
        found = _read_entry(prefix, shards, value)
        if found is not None:
            yield key.decode("utf-8", "replace"), found


def _read_entry(prefix: Path, shards: int, value: bytes) -> npt.NDArray[Any] | None:
    """The tensor that an entry describes; None for text and for parts of sliced variables."""
    fields: dict[int, int | bytes] = {}
    for number, field in _fields(value):
        if number == 7:
            return None
        fields[number] = field
    kind = _TYPES.get(_number(fields.get(1, 0)))
    if kind is None:
        return None
    shape = _read_shape(fields.get(2, b""))
    shard, offset, size = (_number(fields.get(number, 0)) for number in (3, 4, 5))
    dtype = np.dtype(kind)
    if shard >= shards or math.prod(shape) * dtype.itemsize != size:
        msg = f"a tensor of shape {shape} is said to have {size} bytes"
        raise _Malformed(msg)
    data = _read_data(prefix, shard, shards, offset, size)
    if 6 in fields and _masked(crc32c(data)) != _number(fields[6]):
        msg = f"the bytes of a tensor of shape {shape} are damaged"
        raise _Malformed(msg)
    return np.frombuffer(data, dtype).reshape(shape).copy()


def _read_shape(field: int | bytes) -> tuple[int, ...]:
    shape = []
    for number, dimension in _fields(_text(field)):
        if number == 2:
            shape.append(_number(dict(_fields(_text(dimension))).get(1, 0)))
    if len(shape) > 8 or any(size >= 1 << 40 for size in shape):
        msg = "a tensor has an impossible shape"
        raise _Malformed(msg)
    return tuple(shape)


def _read_data(prefix: Path, shard: int, shards: int, offset: int, size: int) -> bytes:
    path = prefix.with_name(f"{prefix.name}.data-{shard:05d}-of-{shards:05d}")
    if not path.is_file():
        msg = f"{path}: no such file; it holds the numbers of {prefix.name}.index"
        raise WeightsMissing(msg)
    with path.open("rb") as stream:
        if offset + size > path.stat().st_size:
            msg = f"{path.name} is cut off"
            raise _Malformed(msg)
        stream.seek(offset)
        return stream.read(size)


def _read_table(table: bytes) -> Iterator[tuple[bytes, bytes]]:
    """Keys and values of a LevelDB table."""
    if len(table) < _FOOTER or struct.unpack("<Q", table[-8:])[0] != _MAGIC:
        msg = "it does not end as such an index does"
        raise _Malformed(msg)
    footer = table[-_FOOTER:-8]
    place = 0
    for _ in range(2):  # an index of properties comes first
        _, place = _varint(footer, place)
    count = 0
    for _, handle in _read_block(table, *_handle(footer[place:])):
        for entry in _read_block(table, *_handle(handle)):
            count += 1
            if count > _MOST_ENTRIES:
                msg = "it has too many entries"
                raise _Malformed(msg)
            yield entry


def _handle(raw: bytes) -> tuple[int, int]:
    offset, place = _varint(raw, 0)
    return offset, _varint(raw, place)[0]


def _read_block(table: bytes, offset: int, size: int) -> Iterator[tuple[bytes, bytes]]:
    end = offset + size
    if size < 4 or end + 5 > len(table):
        msg = "a block lies outside the file"
        raise _Malformed(msg)
    if table[end] != 0:
        msg = "its blocks are compressed, which TensorFlow does not do"
        raise _Malformed(msg)
    if _masked(crc32c(table[offset : end + 1])) != struct.unpack_from("<I", table, end + 1)[0]:
        msg = "a block is damaged"
        raise _Malformed(msg)
    block = table[offset:end]
    stop = size - 4 - 4 * struct.unpack_from("<I", block, size - 4)[0]
    place, key = 0, b""
    while place < stop:
        shared, place = _varint(block, place)
        fresh, place = _varint(block, place)
        length, place = _varint(block, place)
        if shared > len(key) or place + fresh + length > stop:
            msg = "an entry lies outside its block"
            raise _Malformed(msg)
        key = key[:shared] + block[place : place + fresh]
        place += fresh
        yield key, block[place : place + length]
        place += length


def _fields(message: bytes) -> Iterator[tuple[int, int | bytes]]:
    """Field numbers and values of a protocol buffer."""
    place = 0
    while place < len(message):
        tag, place = _varint(message, place)
        kind = tag & 7
        if kind == 0:
            value, place = _varint(message, place)
            yield tag >> 3, value
            continue
        length = {1: 8, 5: 4}.get(kind)
        if kind == 2:
            length, place = _varint(message, place)
        if length is None or place + length > len(message):
            msg = "an entry is no protocol buffer"
            raise _Malformed(msg)
        raw = message[place : place + length]
        place += length
        yield tag >> 3, raw if kind == 2 else int.from_bytes(raw, "little")


def _varint(raw: bytes, place: int) -> tuple[int, int]:
    value = 0
    for shift in range(0, 70, 7):
        if place >= len(raw):
            break
        byte = raw[place]
        place += 1
        value |= (byte & 0x7F) << shift
        if byte < 0x80:
            return value, place
    msg = "a number in it does not end"
    raise _Malformed(msg)


def _number(field: int | bytes) -> int:
    if isinstance(field, int):
        return field
    msg = "an entry has bytes where a number belongs"
    raise _Malformed(msg)


def _text(field: int | bytes) -> bytes:
    if isinstance(field, bytes):
        return field
    msg = "an entry has a number where bytes belong"
    raise _Malformed(msg)


def _make_table() -> npt.NDArray[np.uint32]:
    table = np.arange(256, dtype=np.uint32)
    for _ in range(8):
        table = np.where(table & 1, (table >> 1) ^ np.uint32(0x82F63B78), table >> 1)
    return table.astype(np.uint32)


_TABLE = _make_table()


def crc32c(data: bytes) -> int:
    """The checksum of Castagnoli's polynomial, as TensorFlow and LevelDB use it.

    Long data is cut into lanes that are summed side by side: a checksum is linear, so that what a
    lane contributes is its own sum moved on by the length of all that follow.
    """
    table = [int(value) for value in _TABLE]
    state = 0xFFFFFFFF
    length = len(data) // _LANES if len(data) >= 16 * _LANES else 0
    if length:
        bytes_ = np.frombuffer(data, np.uint8, length * _LANES).reshape(_LANES, length)
        # 32 more lanes of zeros, one for each bit, tell how a state moves on.
        columns = np.vstack([bytes_, np.zeros((32, length), np.uint8)]).T.copy()
        states = np.concatenate(
            [np.zeros(_LANES, np.uint32), np.uint32(1) << np.arange(32, dtype=np.uint32)]
        )
        for column in columns:
            states = _TABLE[(states ^ column) & 0xFF] ^ (states >> 8)
        moves = [int(value) for value in states[_LANES:]]
        for own in states[:_LANES]:
            moved = 0
            for bit in range(32):
                if state >> bit & 1:
                    moved ^= moves[bit]
            state = moved ^ int(own)
    for byte in data[length * _LANES :]:
        state = table[(state ^ byte) & 0xFF] ^ (state >> 8)
    return state ^ 0xFFFFFFFF


def _masked(crc: int) -> int:
    return ((crc >> 15 | crc << 17) + 0xA282EAD8) & 0xFFFFFFFF
