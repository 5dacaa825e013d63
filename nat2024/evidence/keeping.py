"""Keeping what took long to compute, under digests of all that it was made from.

One file a sequence, `.evidence/SEQUENCE.msgpack`, whose entries are found by their digests: an
entry that was made from something else has another digest and is not found. Entries are never
changed.
"""

import hashlib
from pathlib import Path
from typing import Any, TypeVar

import msgspec
import numpy as np

from nat2024.errors import Unwritable
from nat2024.files import write_atomic
from nat2024.types import Sequence

FOLDER = ".evidence"
VERSION = 2
"""Of the computations; raise it when any of them gives other numbers."""

_MOST_UNUSED = 500  # entries of runs that were not asked for; beyond it the oldest go
_Kind = TypeVar("_Kind")


class _File(msgspec.Struct):
    entries: dict[str, msgspec.Raw] = {}


def digest(*parts: Any) -> str:
    """Digest of plain values, bytes and arrays in their order."""
    found = hashlib.sha256(f"{VERSION}".encode())
    for part in parts:
        if isinstance(part, np.ndarray):
            raw = np.ascontiguousarray(part).tobytes()
        elif isinstance(part, bytes):
            raw = part
        else:
            raw = msgspec.msgpack.encode(part, order="sorted")
        found.update(f"{len(raw)}:".encode() + raw)
    return found.hexdigest()[:32]


def frame_identity(sequence: Sequence, index: int) -> str | None:
    """Tells one frame from another: file, size and time of change; None for frames in no file."""
    frames: Any = sequence.frames
    path = getattr(frames, "path", None)
    if callable(path):
        path = path(index)
    if not isinstance(path, Path):
        return None
    for file in (path, *path.parents):  # a frame inside an archive has the archive's
        try:
            found = file.stat()
        except OSError:
            continue
        if not file.is_file():
            return None
        return f"{path}|{index}|{found.st_size}|{found.st_mtime_ns}"
    return None


class Keeper:
    """What is kept of one sequence; `save` writes what came new."""

    def __init__(self, folder: Path | None, sequence: str) -> None:
        """Read what there is; a damaged file is as none.

        Args:
            folder: the dataset's folder of results; None keeps nothing.
            sequence: its name.
        """
        self._path = folder / FOLDER / f"{sequence}.msgpack" if folder else None
        self._used: dict[str, msgspec.Raw] = {}
        self._is_changed = False
        try:
            raw = self._path.read_bytes() if self._path else b""
            self._entries = msgspec.msgpack.decode(raw, type=_File).entries
        except (OSError, msgspec.MsgspecError):
            self._entries = {}

    def get(self, key: str | None, kind: type[_Kind]) -> _Kind | None:
        """The entry of a key, None where there is none."""
        raw = self._entries.get(key) if key else None
        if raw is None or key is None:
            return None
        try:
            value = msgspec.msgpack.decode(raw, type=kind)
        except msgspec.MsgspecError:
            return None
        self._used[key] = raw
        return value

    def put(self, key: str | None, value: Any) -> None:
        """Keep a value; without a key it is not kept."""
        if key:
            self._used[key] = msgspec.Raw(msgspec.msgpack.encode(value))
            self._is_changed = True

    def save(self) -> Unwritable | None:
        """Write the file where something came new; gives the error where that cannot be."""
        if not self._is_changed or self._path is None:
            return None
        unused = [(k, v) for k, v in self._entries.items() if k not in self._used]
        entries = dict(unused[-_MOST_UNUSED:]) | self._used
        try:
            write_atomic(self._path, msgspec.msgpack.encode(_File(entries)))
        except Unwritable as error:
            return error
        return None
