"""A video of the run, with whatever somebody drew into its frames."""

from contextlib import ExitStack
from pathlib import Path
from types import TracebackType

import numpy as np

from nat2024.datasets.video_writing import VideoFile
from nat2024.types import Image

WIDEST = 1280
"""Wider frames are scaled down, in pixels."""


class Film:
    """A WebM video written frame by frame; use it in a `with` block.

    The size is that of the first frame, at most `WIDEST` pixels wide, with even sides as the codec
    needs them; other frames are scaled to it. Without a frame there is no video.
    """

    def __init__(self, path: Path, rate: float) -> None:
        """Keep where it goes and how many frames a second it shows."""
        self._path, self._rate = path, rate
        self._stack = ExitStack()
        self._file: VideoFile | None = None
        self._size = (0, 0)
        self._last: Image | None = None

    def __enter__(self) -> "Film":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._stack.close()  # as a whole video, whatever ended the run

    def write(self, frame: Image | None) -> None:
        """Add a frame, uint8 (H, W, 3) BGR; None holds the last one, as a late display does.

        Raises:
            Unwritable: the video cannot be written.
        """
        if frame is not None:
            if self._file is None:
                self._file = self._begin(frame)
            self._last = _scaled(frame, self._size)
        if self._file is not None and self._last is not None:
            self._file.write(self._last)

    def _begin(self, frame: Image) -> VideoFile:
        scale = min(1.0, WIDEST / frame.shape[1])
        width, height = (max(2, round(side * scale / 2) * 2) for side in frame.shape[1::-1])
        self._size = (width, height)
        return self._stack.enter_context(VideoFile(self._path, self._size, self._rate))


def _scaled(frame: Image, size: tuple[int, int]) -> Image:
    import cv2

    if (frame.shape[1], frame.shape[0]) == size:
        return frame
    return np.asarray(cv2.resize(frame, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)
