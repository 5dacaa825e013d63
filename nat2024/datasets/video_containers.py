"""What a video file is before FFmpeg sees it: a container of a known kind, with honest tables.

FFmpeg keeps 24 bytes for every sample that the tables of an MP4 file claim, before it looks for
one. So a file of a thousand bytes may ask for gigabytes, and is refused here.
"""

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from nat2024.archives import split_path
from nat2024.errors import FrameUnreadable

MOST_SAMPLES = 2**24
"""Samples (frames, or pieces of sound) beyond which a file must hold a byte for each."""

_ATOMS = (b"ftyp", b"moov", b"mdat", b"wide", b"free", b"skip", b"pnot")
_CONTAINERS = frozenset(
    {b"moov", b"trak", b"mdia", b"minf", b"stbl", b"moof", b"traf", b"mvex", b"edts", b"udta"}
)
_DEEPEST = 16
_MOST_BOXES = 2**20  # an hour of fragments of one frame has fewer


def check_container(path: Path) -> None:
    """Refuse what is no container of these kinds: FFmpeg would also follow lists of other files.

    Raises:
        FrameUnreadable: it cannot be read, is no mp4, mov, avi, webm or mkv, or claims more
            samples than it can hold; names it.
    """
    if split_path(path):
        msg = f"{path}: videos are not read out of an archive; unpack it"
        raise FrameUnreadable(msg)
    try:
        with path.open("rb") as file:
            fault = _fault(file)
    except OSError as error:
        msg = f"{path}: cannot be read ({error.strerror})"
        raise FrameUnreadable(msg) from None
    if fault:
        msg = f"{path}: {fault}; get this file again"
        raise FrameUnreadable(msg)


def _fault(file: BinaryIO) -> str:
    start = file.read(12)
    is_avi = start[:4] == b"RIFF" and start[8:] == b"AVI "
    if is_avi or start[:4] == b"\x1aE\xdf\xa3":
        return ""
    if start[4:8] not in _ATOMS:
        return "no video, it begins like no mp4, mov, avi, webm or mkv"
    size = file.seek(0, 2)
    claimed, most = 0, max(MOST_SAMPLES, size)
    for number, (kind, begin, end) in enumerate(_boxes(file, 0, size)):
        if number >= _MOST_BOXES:
            return f"has more than {_MOST_BOXES} boxes"
        if kind == b"cmov":
            return "its header is compressed, which is not read"
        if kind in (b"stsz", b"trun"):
            claimed += _samples(file, begin, end, kind)
        if claimed > most:
            return f"claims {claimed} samples in {size} bytes"
    return ""


def _boxes(
    file: BinaryIO, begin: int, end: int, depth: int = 0
) -> Iterator[tuple[bytes, int, int]]:
    """Kind of each box of an MP4 file, and where its content begins and ends; those within too."""
    while begin + 8 <= end:
        file.seek(begin)
        head = file.read(16)
        size, kind = struct.unpack(">I4s", head[:8])
        content = begin + 8
        if size == 1 and len(head) == 16:
            (size,), content = struct.unpack(">Q", head[8:]), begin + 16
        last = end if size == 0 else min(begin + size, end)
        if last < content:
            return
        yield kind, content, last
        if kind in _CONTAINERS and depth < _DEEPEST:
            yield from _boxes(file, content, last, depth + 1)
        begin = last


def _samples(file: BinaryIO, begin: int, end: int, kind: bytes) -> int:
    """How many samples a table claims."""
    file.seek(begin)
    table = file.read(min(12, end - begin))
    place = 8 if kind == b"stsz" else 4  # version, flags and for `stsz` one size for all before it
    return int.from_bytes(table[place : place + 4], "big")
