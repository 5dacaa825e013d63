"""Plugins for tests: trackers that stand still, fail, die or hang, and an enhancer that inverts."""

import os
import time
from typing import Any

import numpy as np

from nat2024 import Enhancer, Tracker, register_enhancer, register_tracker
from nat2024.cards import Card


class _Small(Tracker):
    card = Card(title="Small", summary="For tests.", scopes=("frame", "patch"))

    def start(self, image: Any, box: Any) -> Any:
        self._frame, self._box = 0, box
        return self.see(image)

    def advance(self, image: Any) -> Any:
        self._frame += 1
        return self.see(image), 1.0

    def see(self, image: Any) -> Any:
        """The start box, moved by the mean brightness so that pixels and enhancers matter."""
        return self._box + np.array([image.mean() / 100, 0, 0, 0])


@register_tracker("still")
class Still(_Small):
    """Stays where it started."""

    def __init__(self, *, step: float = 0.0, **common: Any) -> None:
        super().__init__(**common)
        self.step = step

    def see(self, image: Any) -> Any:
        return super().see(image) + self.step * self._frame


@register_tracker("slow")
class Slow(_Small):
    """Takes five milliseconds a frame."""

    def see(self, image: Any) -> Any:
        time.sleep(0.005)
        return super().see(image)


@register_tracker("fails")
class Fails(_Small):
    """Raises in the fifth frame of a sequence with a wide target."""

    def see(self, image: Any) -> Any:
        if self._frame == 4 and self._box[2] > 20:
            message = "lost its mind"
            raise ValueError(message)
        return super().see(image)


@register_tracker("dies")
class Dies(_Small):
    """Takes its whole process down in the fifth frame of a sequence with a wide target."""

    def see(self, image: Any) -> Any:
        if self._frame == 4 and self._box[2] > 20:
            os._exit(9)
        return super().see(image)


@register_tracker("hangs")
class Hangs(_Small):
    """Hangs for good in the second frame of a sequence with a wide target."""

    def see(self, image: Any) -> Any:
        if self._frame and self._box[2] > 20:
            time.sleep(600)
        return super().see(image)


@register_enhancer("invert")
class Invert(Enhancer):
    """1 - x."""

    card = Card(title="Invert", summary="For tests.")

    def enhance_batch(self, batch: Any) -> Any:
        return 1 - batch
