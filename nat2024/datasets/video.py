"""Frames of a video file, decoded only when asked for, always the exact frame.

Containers lie about the number of their frames, and seeking may land beside the frame that was
asked for. So a video is decoded once to the end: this gives the number of frames, and the time and
a checksum of each. A frame that a seek finds is taken only where both agree; otherwise the video
is decoded anew from its start.
"""

import bisect
import contextlib
import os
import threading
import weakref
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, SupportsIndex

import numpy as np

from nat2024.datasets.decoding import size_fault
from nat2024.datasets.video_containers import check_container
from nat2024.datasets.video_index import VideoIndex, kept_index
from nat2024.errors import FrameUnreadable
from nat2024.types import Image

if TYPE_CHECKING:
    import cv2

VIDEO_EXTENSIONS = frozenset({".mp4", ".avi", ".webm", ".mkv", ".mov"})
_NEAR = 32  # frames that are rather stepped over than jumped
_CHECKED_ROWS = 16  # every so many-th row goes into the checksum
_SAME_MS = 0.01
_OPEN_AT_ONCE = 4


class VideoFrames:
    """The frames of one video file; a `FrameSource`.

    Cheap to make and to send to another process: the file is opened at the first look at it. Frames
    in order are decoded at full speed; another one is sought and checked. Rotation in the
    metadata is ignored, as with images.
    """

    def __init__(self, path: Path, count: int | None = None) -> None:
        """Keep where the video is.

        Args:
            path: of the video file.
            count: take only so many frames from its start; None takes all.
        """
        self.path = path
        self._count = count
        self._index: VideoIndex | None = None
        self._reader: _Reader | None = None
        self._lock = threading.RLock()

    @property
    def folder(self) -> Path:
        """Where the video lies."""
        return self.path.parent

    @property
    def names(self) -> tuple[str, ...]:
        """Empty: frames of a video have no names."""
        return ()

    @property
    def index(self) -> VideoIndex:
        """What decoding the whole video has told; kept, and stored where that took long.

        Raises:
            FrameUnreadable: the file is no video that can be decoded; names it.
        """
        with self._lock:
            if self._index is None:
                check_container(self.path)
                self._index = kept_index(self.path, _decode_all)
            return self._index

    @property
    def frame_size(self) -> tuple[int, int]:
        """(width, height) of the frames in pixels.

        Raises:
            FrameUnreadable: as `index`.
        """
        return self.index.width, self.index.height

    def __bool__(self) -> bool:
        """Whether there is a file; nothing is opened."""
        return self._count != 0

    def __len__(self) -> int:
        """Number of frames that can be decoded; `FrameUnreadable` where there is no video."""
        count = len(self.index.times)
        return count if self._count is None else min(count, self._count)

    def __getitem__(self, index: SupportsIndex, /) -> Image:
        """Frame `index` (0-based), uint8 (H, W, 3) BGR.

        Raises:
            FrameUnreadable: the video, or this frame, cannot be decoded; names file and frame.
        """
        number = range(len(self))[index]
        with self._lock:
            if self._reader is None:
                self._reader = _Reader(self.path, self.index)
                _close_others(self)
            return self._reader.read(number)

    def title(self, index: SupportsIndex) -> str:
        """What to call frame `index` (0-based) in a line for people."""
        return f"{self.path.name} frame {index.__index__()}"

    def cut(self, count: int) -> "VideoFrames":
        """The first `count` frames."""
        shorter = VideoFrames(self.path, min(count, len(self)))
        shorter._index = self._index
        return shorter

    def close(self) -> None:
        """Close the file; it is opened again where needed."""
        with self._lock:
            if self._reader:
                self._reader.close()
            self._reader = None

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, VideoFrames):
            return NotImplemented
        return (self.path, self._count) == (other.path, other._count)

    def __hash__(self) -> int:
        return hash((self.path, self._count))

    def __repr__(self) -> str:
        return f"VideoFrames({self.path!r})"

    def __getstate__(self) -> dict[str, Any]:
        return {"path": self.path, "_count": self._count, "_index": self._index}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__init__(state["path"], state["_count"])  # type: ignore[misc]
        self._index = state["_index"]


class _Reader:
    """An open video, and the number of the frame that comes next."""

    def __init__(self, path: Path, index: VideoIndex) -> None:
        self._path, self._index, self._is_seekable = path, index, index.is_seekable
        self._capture = _open(path)
        self._next = 0

    def close(self) -> None:
        self._capture.release()

    def read(self, number: int) -> Image:
        near = 0 <= number - self._next <= _NEAR
        image = self._forward(number) if near else self._seek(number)
        if image is None:
            image = self._from_start(number)
        if image is None:
            msg = (
                f"{self._path} (frame {number}, counted from 0): does not decode as it did "
                "before; is the file being changed?"
            )
            raise FrameUnreadable(msg)
        return image

    def _seek(self, number: int) -> Image | None:
        """Jump, and go on to the frame that is wanted; None where that does not lead to it.

        FFmpeg finds frames by an even rate, so in a video of uneven times it may land after the one
        that is wanted. It is then told to aim as much before it, and a little more.
        """
        landed = self._land(number) if self._is_seekable else None
        if landed is not None and landed > number:
            landed = self._land(max(0, 2 * number - landed - _NEAR))
        if landed is None or landed > number:
            return None
        self._next = landed + 1
        return self._retrieve(number) if landed == number else self._forward(number)

    def _land(self, aim: int) -> int | None:
        """The number of the frame, told by its time, that is grabbed after a jump."""
        import cv2

        self._capture.set(cv2.CAP_PROP_POS_FRAMES, aim)
        if not self._capture.grab():
            return None
        landed = bisect.bisect_left(self._index.times, _time(self._capture) - _SAME_MS)
        return landed if self._is_at(landed) else None

    def _forward(self, number: int) -> Image | None:
        while self._next <= number:
            if not self._capture.grab():
                return None
            self._next += 1
        return self._retrieve(number)

    def _from_start(self, number: int) -> Image | None:
        self._capture.release()
        self._capture, self._next = _open(self._path), 0
        return self._forward(number)

    def _retrieve(self, number: int) -> Image | None:
        """The frame that was grabbed last, if it is frame `number` beyond doubt."""
        if not self._is_at(number):
            return None
        ok, image = self._capture.retrieve()
        if not ok or _checksum(image) != self._index.checksums[number]:
            return None
        return np.asarray(image, dtype=np.uint8)

    def _is_at(self, number: int) -> bool:
        times = self._index.times
        return number < len(times) and abs(_time(self._capture) - times[number]) < _SAME_MS


def _decode_all(path: Path) -> VideoIndex:
    import cv2

    capture = _open(path)
    times, checksums, sizes = [], [], set()
    code = round(capture.get(cv2.CAP_PROP_FOURCC)).to_bytes(8, "little", signed=True)
    codec = code[:4].decode("ascii", "replace")
    stated = max(0, round(capture.get(cv2.CAP_PROP_FRAME_COUNT)))
    try:
        while capture.grab():
            ok, image = capture.retrieve()
            if not ok:
                break
            times.append(_time(capture))
            checksums.append(_checksum(image))
            sizes.add((image.shape[1], image.shape[0]))
    finally:
        capture.release()
    if not times:
        msg = (
            f"{path}: not one frame can be decoded; it is damaged, or OpenCV lacks its codec "
            f"({codec}): write it anew as H.264"
        )
        raise FrameUnreadable(msg)
    if len(sizes) > 1:
        msg = f"{path}: the frame size changes within the video; write it anew in one size"
        raise FrameUnreadable(msg)
    ((width, height),) = sizes
    return VideoIndex(width, height, stated, tuple(times), tuple(checksums))


def open_video(path: Path) -> "cv2.VideoCapture":
    """Open a video file to be decoded in order, rotation in its metadata ignored.

    Raises:
        FrameUnreadable: it is no mp4, mov, avi, webm or mkv, or cannot be decoded; names it.
    """
    check_container(path)
    return _open(path)


def _open(path: Path) -> "cv2.VideoCapture":
    """Open with FFmpeg, which all wheels of OpenCV carry; on one thread it decodes alike always."""
    import cv2

    with quiet_opencv():
        capture = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG, [cv2.CAP_PROP_N_THREADS, 1])
    if not capture.isOpened():
        msg = f"{path}: cannot be opened as a video; get this file again"
        raise FrameUnreadable(msg)
    size = [round(capture.get(p)) for p in (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT)]
    fault = size_fault((size[0], size[1]))
    if fault:
        capture.release()
        msg = f"{path}: {fault}"
        raise FrameUnreadable(msg)
    capture.set(cv2.CAP_PROP_ORIENTATION_AUTO, 0)
    return capture


def _time(capture: "cv2.VideoCapture") -> float:
    import cv2

    return float(capture.get(cv2.CAP_PROP_POS_MSEC))


def _checksum(image: Any) -> int:
    return zlib.crc32(image[::_CHECKED_ROWS].tobytes())


@contextlib.contextmanager
def quiet_opencv() -> Iterator[None]:
    """Let OpenCV not write of its own about a file or stream that our error names."""
    import cv2

    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")  # FFmpeg's own lines
    logging: Any = cv2.utils.logging
    before = logging.getLogLevel()
    logging.setLogLevel(0)
    try:
        yield
    finally:
        logging.setLogLevel(before)


_opened: list[weakref.ref[VideoFrames]] = []


def _close_others(newest: VideoFrames) -> None:
    """Keep only a few videos open, the last used; one that another thread reads is left alone."""
    _opened.append(weakref.ref(newest))
    while len(_opened) > _OPEN_AT_ONCE:
        oldest = _opened.pop(0)()
        if oldest is not None and oldest is not newest and oldest._lock.acquire(blocking=False):
            oldest.close()
            oldest._lock.release()
