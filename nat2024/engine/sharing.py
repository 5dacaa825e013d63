"""Enhanced frames that several trackers share, so that each is computed once."""

from collections import OrderedDict
from collections.abc import Callable

from nat2024.types import Image


class SharedFrames:
    """The last few frames of one enhancer, beside the frames that they were made of.

    Everybody gets a copy of their own: a tracker that draws into its frame harms no other.
    """

    def __init__(self, size: int = 1) -> None:
        """Keep so many frames at most; the one used longest ago goes first."""
        self.size = size
        self._kept: OrderedDict[int, tuple[Image, Image, float]] = OrderedDict()

    def get(self, frame: Image, enhance: Callable[[], tuple[Image, float]]) -> tuple[Image, float]:
        """The enhanced frame, and the seconds that it took when it was made.

        Args:
            frame: what is enhanced; the same array object is the same frame.
            enhance: makes the enhanced frame and tells its seconds, where it is not kept.
        """
        kept = self._kept.get(id(frame))
        if kept is None:
            kept = (frame, *enhance())
            self._kept[id(frame)] = kept
            while len(self._kept) > self.size:
                self._kept.popitem(last=False)
        else:
            self._kept.move_to_end(id(frame))
        return kept[1].copy(), kept[2]

    def clear(self) -> None:
        """Forget all frames."""
        self._kept.clear()
