"""Writing videos with the codecs that OpenCV's wheels bring: VP8 in WebM, else frames."""

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from nat2024.errors import Unwritable
from nat2024.files import remove_leftovers, temporary_beside
from nat2024.types import Image

if TYPE_CHECKING:
    import cv2

VIDEO_ENDING = ".webm"
_CODEC = "VP80"


def can_be_video(width: int, height: int) -> bool:
    """Whether frames of this size are written whole: the codec cuts sides to even numbers."""
    return width % 2 == 0 and height % 2 == 0


class VideoFile:
    """A video that is there only when it is whole; a context manager around the writing."""

    def __init__(self, path: Path, size: tuple[int, int], rate: float) -> None:
        """Keep what is to be written.

        Args:
            path: of the video, ending in `VIDEO_ENDING`.
            size: (width, height), both even.
            rate: frames a second.
        """
        self._path, self._size, self._rate = path, size, rate
        self._begun = temporary_beside(path, VIDEO_ENDING)  # FFmpeg goes by the ending
        self._writer: cv2.VideoWriter | None = None

    def __enter__(self) -> "VideoFile":
        """Begin; what killed processes have left beside it is removed.

        Raises:
            Unwritable: the file system refuses, or this OpenCV has no such codec.
        """
        import cv2

        try:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            remove_leftovers(self._path.parent)
        except OSError as error:
            msg = f"{self._path}: cannot be written ({error.strerror or error})"
            raise Unwritable(msg) from None
        code = cv2.VideoWriter.fourcc(*_CODEC)
        with _quiet_opening():
            writer = cv2.VideoWriter(str(self._begun), cv2.CAP_FFMPEG, code, self._rate, self._size)
        if not writer.isOpened():
            msg = f"{self._path}: cannot be written as video ({_CODEC}); write frames (--frames)"
            raise Unwritable(msg)
        self._writer = writer
        return self

    def write(self, image: Image) -> None:
        """Append a frame, uint8 (H, W, 3) BGR of the size given."""
        assert self._writer is not None
        self._writer.write(image)

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        """Put the whole video at its place, or remove what was begun."""
        if self._writer is not None:
            self._writer.release()
        if kind is None:
            try:
                self._begun.replace(self._path)
            except OSError as error:
                msg = f"{self._path}: cannot be written ({error.strerror or error})"
                raise Unwritable(msg) from None
        else:
            self._begun.unlink(missing_ok=True)


@contextlib.contextmanager
def _quiet_opening() -> Iterator[None]:
    """Keep OpenCV from writing a remark about WebM's tags straight to standard error."""
    try:
        kept = os.dup(2)
    except OSError:  # no standard error at all
        yield
        return
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 2)
        yield
    finally:
        os.dup2(kept, 2)
        os.close(nowhere)
        os.close(kept)
