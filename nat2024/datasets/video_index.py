"""What decoding a video once has told, kept where that took long."""

import contextlib
import hashlib
import itertools
import time
from collections.abc import Callable
from pathlib import Path

import msgspec

from nat2024.errors import Unwritable
from nat2024.files import write_atomic
from nat2024.keeping import cache_folder

_FORMAT = 1
_WORTH_STORING_S = 0.5


class VideoIndex(msgspec.Struct, frozen=True):
    """All frames of a video.

    Attributes:
        width: of the frames in pixels.
        height: of the frames in pixels.
        stated: number of frames as the container states it, often an estimate.
        times: of each frame in milliseconds, as FFmpeg tells it.
        checksums: crc32 over rows of each frame.
    """

    width: int
    height: int
    stated: int
    times: tuple[float, ...]
    checksums: tuple[int, ...]

    @property
    def is_seekable(self) -> bool:
        """Whether times tell frames apart."""
        return all(a < b for a, b in itertools.pairwise(self.times))


def kept_index(path: Path, make: Callable[[Path], VideoIndex]) -> VideoIndex:
    """The stored index of an unchanged video, else a new one, stored if it took long to make.

    It is stored in the user's cache folder, or in the one that NAT2024_CACHE names; where that
    cannot be written, it is made anew each time.
    """
    import cv2

    state = path.stat()
    key = f"{_FORMAT}\0{path.resolve()}\0{state.st_size}\0{state.st_mtime_ns}\0{cv2.__version__}"
    file = cache_folder() / "videos" / f"{hashlib.sha256(key.encode()).hexdigest()[:32]}.json"
    try:
        return msgspec.json.decode(file.read_bytes(), type=VideoIndex)
    except (OSError, ValueError, RecursionError):  # a damaged one is as none
        pass
    start = time.perf_counter()
    index = make(path)
    if time.perf_counter() - start > _WORTH_STORING_S:
        with contextlib.suppress(Unwritable):  # a cache that cannot be written costs time only
            write_atomic(file, msgspec.json.encode(index))
    return index
