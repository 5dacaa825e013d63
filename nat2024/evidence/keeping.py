"""Where evidence is kept: one file a sequence, `RESULTS/DATASET/.evidence/SEQUENCE.msgpack`."""

from pathlib import Path
from typing import Any

from nat2024 import keeping
from nat2024.keeping import Keeper
from nat2024.types import Sequence

FOLDER = ".evidence"
VERSION = 2
"""Of the computations; raise it when any of them gives other numbers."""

_MOST_UNUSED = 500  # entries of runs that were not asked for


def digest(*parts: Any) -> str:
    """Digest of plain values, bytes and arrays in their order, and of the computations."""
    return keeping.digest(VERSION, *parts)


def open_keeper(folder: Path | None, sequence: str) -> Keeper:
    """What is kept of one sequence in the dataset's folder of results; None keeps nothing."""
    path = folder / FOLDER / f"{sequence}.msgpack" if folder else None
    return Keeper(path, most_unused=_MOST_UNUSED)


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
