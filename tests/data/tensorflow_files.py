"""Writes TensorFlow checkpoints (tensor bundles) by hand, for tests of the reader."""

import struct

import numpy as np

_TYPES = {"float32": 1, "float64": 2, "int32": 3, "int64": 9, "bool": 10}


def crc32c(data):
    """Bit by bit, as the polynomial defines it."""
    state = 0xFFFFFFFF
    for byte in data:
        state ^= byte
        for _ in range(8):
            state = (state >> 1) ^ (0x82F63B78 if state & 1 else 0)
    return state ^ 0xFFFFFFFF


def masked(data, crc=crc32c):
    value = crc(data)
    return (((value >> 15) | (value << 17)) + 0xA282EAD8) & 0xFFFFFFFF


def varint(number):
    out = b""
    while number >= 0x80:
        out += bytes([number & 0x7F | 0x80])
        number >>= 7
    return out + bytes([number])


def block_of(entries, share=True):
    """A LevelDB block whose keys leave out what they share with the one before."""
    out, before = b"", b""
    for key, value in entries:
        shared = 0
        while share and shared < min(len(key), len(before)) and key[shared] == before[shared]:
            shared += 1
        out += varint(shared) + varint(len(key) - shared) + varint(len(value))
        out += key[shared:] + value
        before = key
    return out + struct.pack("<II", 0, 1)


def write_checkpoint(prefix, arrays, per_block=7, crc=crc32c):
    """Write PREFIX.index and PREFIX.data-00000-of-00001."""
    data, entries = b"", [(b"", b"\x08\x01")]
    for name in sorted(arrays):
        array = np.ascontiguousarray(arrays[name])
        raw = array.tobytes()
        sizes = b"".join(
            b"\x12" + varint(len(size)) + size
            for size in (b"\x08" + varint(number) for number in array.shape)
        )
        entry = b"\x08" + varint(_TYPES[str(array.dtype)]) + b"\x12" + varint(len(sizes)) + sizes
        entry += b"\x20" + varint(len(data)) + b"\x28" + varint(len(raw))
        entry += b"\x35" + struct.pack("<I", masked(raw, crc))
        entries.append((name.encode(), entry))
        data += raw
    table, handles = b"", []

    def add(block):
        nonlocal table
        handle = varint(len(table)) + varint(len(block))
        table += block + b"\x00" + struct.pack("<I", masked(block + b"\x00", crc))
        return handle

    for start in range(0, len(entries), per_block):
        part = entries[start : start + per_block]
        handles.append((part[-1][0], add(block_of(part))))
    footer = add(block_of([])) + add(block_of(handles, share=False))
    table += footer.ljust(40, b"\0") + struct.pack("<Q", 0xDB4775248B80FB57)
    prefix.with_name(prefix.name + ".index").write_bytes(table)
    prefix.with_name(prefix.name + ".data-00000-of-00001").write_bytes(data)
