"""Keeping what took long to compute, under digests of all that it was made from.

A file of entries that are found by their digests: an entry that was made from something else has
another digest and is not found, so nothing kept is ever out of date. Deleting such a file costs
time only. It is written whole, and a damaged one is as none.
"""

import contextlib
import hashlib
import os
from pathlib import Path
from typing import Any, TypeVar

import msgspec
import numpy as np

from nat2024.errors import Unwritable
from nat2024.files import expand, remove_leftovers, write_atomic

_CHECK_BYTES = 16
_Kind = TypeVar("_Kind")


def cache_folder() -> Path:
    """The folder of what can be made again: `NAT2024_CACHE`, else the user's cache folder.

    Anything in it may be deleted at any time.
    """
    given = os.environ.get("NAT2024_CACHE")
    if given:
        return expand(given)
    import platformdirs

    return platformdirs.user_cache_path("nat-bench")


def digest(*parts: Any) -> str:
    """Digest of plain values, bytes and arrays (with shape and type) in their order."""
    found = hashlib.sha256()
    for part in parts:
        if isinstance(part, np.ndarray):
            kind, raw = f"array {part.dtype.str} {part.shape}", np.ascontiguousarray(part).data
        elif isinstance(part, bytes):
            kind, raw = f"bytes {len(part)}", memoryview(part)
        else:
            raw = memoryview(msgspec.msgpack.encode(part, order="sorted"))
            kind = f"value {len(raw)}"
        found.update(f"{kind}:".encode())
        if raw.nbytes:  # an empty array gives no plain bytes
            found.update(raw.cast("B") if raw.ndim != 1 or raw.format != "B" else raw)
    return found.hexdigest()[:32]


class Keeper:
    """One file of entries; `save` writes what came new."""

    def __init__(self, path: Path | None, *, most_unused: int) -> None:
        """Read what there is; a damaged file is as none.

        Args:
            path: of the file; None keeps nothing.
            most_unused: how many entries that nobody asked for stay when the file is written anew;
                beyond it the oldest go.
        """
        self._path = path
        self._most_unused = most_unused
        self._used: dict[str, msgspec.Raw] = {}
        self._is_changed = False
        try:
            raw = path.read_bytes() if path else b""
            self._entries = _checked_entries(raw)
        except (OSError, ValueError, RecursionError):  # no UTF-8 and endless nesting too
            self._entries = {}

    def get(self, key: str | None, kind: type[_Kind]) -> _Kind | None:
        """The entry of a key, None where there is none."""
        raw = self._entries.get(key) if key else None
        if raw is None or key is None:
            return None
        try:
            value = msgspec.msgpack.decode(raw, type=kind)
        except (ValueError, RecursionError):
            return None
        self._used[key] = raw
        return value

    def put(self, key: str | None, value: Any) -> None:
        """Keep a value; without a key, or a file, it is not kept."""
        if key and self._path:
            self._used[key] = msgspec.Raw(msgspec.msgpack.encode(value))
            self._is_changed = True

    def save(self) -> Unwritable | None:
        """Write the file where something came new; gives the error where that cannot be."""
        if self._path is None:
            return None
        if not self._is_changed:
            with contextlib.suppress(OSError):  # so that `trim` knows what is in use
                os.utime(self._path)
            return None
        unused = [(k, v) for k, v in self._entries.items() if k not in self._used]
        kept = unused[-self._most_unused :] if self._most_unused else []
        raw = msgspec.msgpack.encode(dict(kept) | self._used)
        try:
            write_atomic(self._path, _check(raw) + raw, durable=False)
        except Unwritable as error:
            return error
        return None


def _check(raw: bytes) -> bytes:
    return hashlib.sha256(raw).digest()[:_CHECK_BYTES]


def _checked_entries(raw: bytes) -> dict[str, msgspec.Raw]:
    body = raw[_CHECK_BYTES:]
    if not body or _check(body) != raw[:_CHECK_BYTES]:
        return {}
    return msgspec.msgpack.decode(body, type=dict[str, msgspec.Raw])


def trim(folder: Path, most_bytes: int) -> None:
    """Delete the files of a folder that were not used for longest, until the rest is small enough.

    What killed processes have left goes too. Other processes may do the same meanwhile.
    """
    with contextlib.suppress(OSError):
        remove_leftovers(folder)
        states = [(file, file.stat()) for file in folder.iterdir() if not file.name.startswith(".")]
        total = sum(state.st_size for _, state in states)
        for file, state in sorted(states, key=lambda one: one[1].st_mtime_ns):
            if total <= most_bytes:
                return
            file.unlink(missing_ok=True)
            total -= state.st_size
