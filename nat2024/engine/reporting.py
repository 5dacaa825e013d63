"""Telling how far a unit of work has come, not more often than anybody reads it."""

import time
from collections.abc import Callable
from typing import Any, TypeAlias

Tell: TypeAlias = Callable[[int, str], Any]


class Throttled:
    """Adds up frames and tells them at most once in so many seconds; `flush` tells the rest.

    No frames at all are told at once: they say that something has begun.
    """

    def __init__(self, tell: Tell, seconds: float) -> None:
        self._tell, self._seconds = tell, seconds
        self._frames, self._what = 0, ""
        self._last = time.monotonic()

    def __call__(self, frames: int, what: str) -> None:
        """Note frames that were done."""
        self._frames += frames
        self._what = what
        if not frames:
            self._tell(0, what)
        elif time.monotonic() - self._last >= self._seconds:
            self.flush()

    def flush(self) -> None:
        """Tell what has not been told yet."""
        if self._frames:
            self._tell(self._frames, self._what)
        self._frames, self._last = 0, time.monotonic()
