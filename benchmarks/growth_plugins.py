"""Trackers that cost nothing but time, for `growth.py`: what is left is the engine itself."""

import time
from typing import Any

from nat2024 import Tracker, register_tracker
from nat2024.cards import Card


@register_tracker("standing")
class Standing(Tracker):
    """Stays where it started."""

    card = Card(title="Standing", summary="For measurements.", scopes=("frame",))

    def start(self, image: Any, box: Any) -> Any:  # noqa: ARG002
        """The box as given."""
        self._box = box
        return box

    def advance(self, image: Any) -> Any:  # noqa: ARG002
        """The same box again."""
        return self._box, 1.0


@register_tracker("sleeping")
class Sleeping(Standing):
    """Sleeps in every frame, as a tracker does that waits for its GPU: other threads go on."""

    def __init__(self, *, seconds: float = 0.005, **common: Any) -> None:
        super().__init__(**common)
        self.seconds = seconds

    def start(self, image: Any, box: Any) -> Any:
        """The box as given, later."""
        time.sleep(self.seconds)
        return super().start(image, box)

    def advance(self, image: Any) -> Any:
        """The same box again, later."""
        time.sleep(self.seconds)
        return super().advance(image)
