"""Where frames come from: files that wait for the tracker, and cameras that do not."""

import re
import threading
from abc import ABC, abstractmethod
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING

import numpy as np

from nat2024.datasets.frames import FolderFrames
from nat2024.datasets.listings import Listing
from nat2024.datasets.video import VIDEO_EXTENSIONS, open_video, quiet_opencv
from nat2024.errors import FrameUnreadable, UsageError
from nat2024.files import expand
from nat2024.types import Image

if TYPE_CHECKING:
    import cv2

USUAL_RATE = 30.0
"""Frames a second where a source does not say its own rate."""

_TIMEOUT_MS = 10_000
_URL = re.compile(r"(?P<scheme>[a-z][a-z0-9+.-]*)://\S+", re.IGNORECASE)
_SCHEMES = frozenset({"http", "https", "rtsp", "rtsps", "rtmp", "udp", "tcp", "rtp", "srt"})


class LiveSource(ABC):
    """Frames in order; use it in a `with` block.

    Attributes:
        title: what to call it in a line for people.
        rate: frames a second.
        is_live: whether frames come at their own pace, whatever the reader does.
        count: number of frames, None where nobody knows.
    """

    title: str
    rate: float = USUAL_RATE
    is_live: bool = False
    count: int | None = None

    @abstractmethod
    def read(self) -> Image | None:
        """The next frame, uint8 (H, W, 3) BGR; None at the end.

        Raises:
            FrameUnreadable: it cannot be decoded.
        """

    @abstractmethod
    def skip(self, frames: int) -> int:
        """Leave out the next frames; gives how many there were to leave out."""

    def take(self, late: int) -> tuple[int, Image | None]:
        """The next frame for a tracker that is `late` frames behind, and how many it missed.

        A source that waits leaves out as many as it is told; one that does not knows better, and
        gives its newest. None for the frame at the end.
        """
        return self.skip(late), self.read()

    def close(self) -> None:  # noqa: B027 - not every source holds something
        """Let go of file, camera or connection."""

    def __enter__(self) -> "LiveSource":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()


def open_source(text: str, *, rate: float | None = None) -> LiveSource:
    """Open a video file, a folder of images, a camera by its number, or a stream by its URL.

    Args:
        text: path, number or URL.
        rate: frames a second, in place of what the source says.

    Raises:
        UsageError: nothing of that kind is there, or the URL is of a kind that is not taken.
        FrameUnreadable: the file is no video, or camera or stream cannot be opened.
    """
    source = _open(text)
    if rate is not None:
        source.rate = rate
    return source


def _open(text: str) -> LiveSource:
    url = _URL.fullmatch(text)
    if url:
        if url["scheme"].lower() not in _SCHEMES:
            msg = f"{text}: streams are read from {', '.join(sorted(_SCHEMES))} addresses only"
            raise UsageError(msg)
        return StreamSource(text)
    path = expand(text)
    if path.is_dir():
        return FolderSource(path)
    if path.is_file():
        if path.suffix.lower() not in VIDEO_EXTENSIONS:
            known = ", ".join(sorted(VIDEO_EXTENSIONS))
            msg = f"{path}: no video by its name ({known}); for images name their folder"
            raise UsageError(msg)
        return VideoSource(path)
    if text.isascii() and text.isdigit():
        return CameraSource(int(text))
    msg = f"{text}: no such file or folder, and neither a camera's number nor a URL"
    raise UsageError(msg)


class FolderSource(LiveSource):
    """The images of one folder, in natural order of their names."""

    def __init__(self, folder: Path) -> None:
        self.title = folder.name
        self._frames = FolderFrames(folder, Listing.of(folder).images)
        if not self._frames:
            msg = f"{folder}: no images in it"
            raise UsageError(msg)
        self.count = len(self._frames)
        self._next = 0

    def read(self) -> Image | None:
        """The next image; see `LiveSource.read`."""
        if self._next >= len(self._frames):
            return None
        self._next += 1
        return self._frames[self._next - 1]

    def skip(self, frames: int) -> int:
        """Leave out the next images; they are not decoded."""
        skipped = min(frames, len(self._frames) - self._next)
        self._next += skipped
        return skipped


class _CaptureSource(LiveSource):
    """What OpenCV captures; a subclass opens `_capture`."""

    _capture: "cv2.VideoCapture"

    def read(self) -> Image | None:
        """The next frame; see `LiveSource.read`."""
        ok, image = self._capture.read()
        return np.asarray(image, dtype=np.uint8) if ok else None

    def skip(self, frames: int) -> int:
        """Leave out the next frames."""
        return next((n for n in range(frames) if not self._capture.grab()), frames)

    def close(self) -> None:
        """Let go of file or connection."""
        self._capture.release()

    def _take_rate(self) -> None:
        import cv2

        rate = self._capture.get(cv2.CAP_PROP_FPS)
        # Some cameras say 0, some streams 90 000: their clock.
        self.rate = rate if 1 <= rate <= 1000 else USUAL_RATE


class VideoSource(_CaptureSource):
    """A video file, decoded in order."""

    def __init__(self, path: Path) -> None:
        self.title = path.name
        self._capture = open_video(path)
        self._take_rate()


class _PacedSource(_CaptureSource):
    """A camera or stream: a thread takes frames as they come and keeps only the latest.

    So the tracker always gets the newest frame, and is told how many it was too slow for.
    """

    is_live = True

    def __init__(self) -> None:
        self._missed = 0
        self._latest: Image | None = None
        self._ended = False
        self._changed = threading.Condition()
        self._thread: threading.Thread | None = None

    def take(self, late: int) -> tuple[int, Image | None]:  # noqa: ARG002 - time itself tells
        """The newest frame, waited for, and how many were missed before it."""
        if self._thread is None:
            self._thread = threading.Thread(target=self._take_all, name="nat2024 live", daemon=True)
            self._thread.start()
        with self._changed:
            self._changed.wait_for(lambda: self._latest is not None or self._ended)
            image, missed = self._latest, self._missed
            self._latest, self._missed = None, 0
        return missed, image

    def close(self) -> None:
        """End the thread, then let go of the device."""
        with self._changed:
            self._ended = True
        if self._thread:
            self._thread.join()
        super().close()

    def _take_all(self) -> None:
        while not self._ended:
            image = self.read()
            with self._changed:
                if image is None:
                    self._ended = True
                else:
                    self._missed += self._latest is not None
                    self._latest = image
                self._changed.notify_all()


class CameraSource(_PacedSource):
    """A camera of this machine."""

    def __init__(self, number: int) -> None:
        import cv2

        super().__init__()
        self.title = f"camera {number}"
        with quiet_opencv():
            self._capture = cv2.VideoCapture(number)
        if not self._capture.isOpened():
            msg = f"camera {number} cannot be opened; is it there, and may you use it?"
            raise FrameUnreadable(msg)
        self._take_rate()


class StreamSource(_PacedSource):
    """A stream, such as rtsp:// of a drone or MJPEG over http://."""

    def __init__(self, url: str) -> None:
        import cv2

        super().__init__()
        self.title = url
        timeouts = [cv2.CAP_PROP_OPEN_TIMEOUT_MSEC, _TIMEOUT_MS]
        timeouts += [cv2.CAP_PROP_READ_TIMEOUT_MSEC, _TIMEOUT_MS]
        with quiet_opencv():
            self._capture = cv2.VideoCapture(url, cv2.CAP_FFMPEG, timeouts)
        if not self._capture.isOpened():
            msg = f"{url}: cannot be opened as a stream"
            raise FrameUnreadable(msg)
        self._take_rate()
