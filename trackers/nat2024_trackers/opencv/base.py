"""What all adapters of OpenCV trackers share."""

import threading
from abc import abstractmethod
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from nat2024.errors import NatBenchError, WeightsMismatch
from nat2024.interfaces import Tracker
from nat2024.types import Box, Image


class OpenCVFailure(NatBenchError):
    """An OpenCV tracker that cannot be created or stops with an error."""


class OpenCVTracker(Tracker):
    """An adapter; a subclass gives `make`.

    It also gives `confidence` where its tracker has one, and `start_box` where it cannot start on
    every box. The box is rounded to integers, as OpenCV needs it; row 0 of the results is the box
    as given. `device` matters to the enhancer only: the tracker itself runs on the CPU.
    """

    _tracker: Any = None
    _box: Box

    @abstractmethod
    def make(self) -> Any:
        """A new `cv2.Tracker`."""

    def start_box(self, image: Image, box: Box) -> tuple[int, int, int, int]:
        """The box that OpenCV starts on."""
        return integer_box(box, image)

    def confidence(self, tracker: Any) -> float:  # noqa: ARG002 - for subclasses
        """Score of the latest update; NaN where the tracker has none."""
        return float("nan")

    def start(self, image: Image, box: Box) -> Box:
        """Start a new OpenCV tracker on the image."""
        self._tracker, self._box = None, box.copy()
        with explained(self.name), quiet():
            tracker = self.make()
            tracker.init(np.ascontiguousarray(image), self.start_box(image, box))
        self._tracker = tracker
        return box.copy()

    def advance(self, image: Image) -> tuple[Box, float]:
        """Follow into the next image; where the tracker reports a loss the last box stays."""
        with explained(self.name):
            found, box = self._tracker.update(np.ascontiguousarray(image))
            score = self.confidence(self._tracker)
        if found:
            self._box = np.array(box, dtype=np.float64)
        return self._box.copy(), score

    def forget(self) -> None:
        """Drop the OpenCV tracker of the current sequence."""
        self._tracker = None


def finite_score(tracker: Any) -> float:
    """OpenCV's score of the latest update; 0 where it is no finite number."""
    score = float(tracker.getTrackingScore())
    return score if np.isfinite(score) else 0.0


def try_out(tracker: OpenCVTracker, files: str, hint: str = "") -> None:
    """One frame through the networks of a tracker, so that a wrong file is told at creation.

    Args:
        tracker: as just created.
        files: what its weights are, for the error.
        hint: what may be wrong with them, for the error.

    Raises:
        WeightsMismatch: OpenCV stops with an error.
    """
    image = np.zeros((64, 64, 3), dtype=np.uint8)
    box = np.array([24.0, 24.0, 16.0, 16.0])
    try:
        tracker.start(image, box)
        tracker.advance(image)
    except OpenCVFailure as error:
        what = f"no {tracker.card.title.partition(' (')[0]} networks that OpenCV can run"
        msg = f"{files}: {what}{hint and f'; {hint}'} ({error})"
        raise WeightsMismatch(msg) from None
    finally:
        tracker.forget()


def integer_box(box: Box, image: Image) -> tuple[int, int, int, int]:
    """Round x, y, w, h half to even, sizes to at least 1.

    A box wider or higher than the image is cut to it first: OpenCV pads the image to several times
    the box, and overflows on extreme ones.
    """
    x, y, width, height = (float(value) for value in box)
    image_height, image_width = image.shape[:2]
    x, width = _cut(x, width, image_width)
    y, height = _cut(y, height, image_height)
    return round(x), round(y), max(1, round(width)), max(1, round(height))


def _cut(start: float, size: float, limit: int) -> tuple[float, float]:
    if size <= limit:
        return start, size
    low, high = max(0.0, start), min(float(limit), start + size)
    return low, high - low


@contextmanager
def explained(name: str) -> Iterator[None]:
    """Turn OpenCV's errors into one line of ours."""
    import cv2

    try:
        yield
    except cv2.error as error:
        reason = " ".join(str(error.err or error).split())
        msg = f"{name}: OpenCV {cv2.__version__} stops with an error: {reason}"
        raise OpenCVFailure(msg) from None


_quiet_lock = threading.Lock()


@contextmanager
def quiet() -> Iterator[None]:
    """Keep OpenCV's warnings off standard error: OpenCV 5 has a harmless one for each network."""
    import cv2

    logging: Any = cv2.utils.logging
    with _quiet_lock:
        level = logging.getLogLevel()
        logging.setLogLevel(min(level, logging.LOG_LEVEL_ERROR))
        try:
            yield
        finally:
            logging.setLogLevel(level)
