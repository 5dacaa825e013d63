"""The tracker `mil`: OpenCV's TrackerMIL, a sanity baseline without weights."""

from typing import Any, ClassVar

from nat2024.cards import Card
from nat2024.errors import ArrayContract
from nat2024.registry import register_tracker
from nat2024.types import Box, Image
from nat2024_trackers.opencv.base import OpenCVTracker, integer_box

SMALLEST_SIDE = 5
"""Shorter boxes send OpenCV looking for Haar features that do not exist, without end."""

ROOM = 12
"""Pixels that an axis of the image must leave beside the box, for negative samples."""


@register_tracker("mil")
class MIL(OpenCVTracker):
    """Online multiple-instance learning on Haar-like features; constant box size, no score (NaN).

    Two runs on the same frames differ, also after `cv2.setRNGSeed`: report a mean of several.
    """

    card: ClassVar[Card] = Card(
        title="MIL",
        summary="Boosted Haar-like features by multiple-instance learning; a sanity baseline.",
        paper=(
            "B. Babenko, M.-H. Yang, S. Belongie: Visual Tracking with Online Multiple Instance "
            "Learning, CVPR 2009"
        ),
        code="https://github.com/opencv/opencv (modules/video)",
        code_licence="Apache-2.0",
        colour_order="BGR, as OpenCV reads it",
        scopes=("frame",),
        repeatable=False,
        state="OpenCV's own implementation",
        differences=(
            "not repeatable: two runs on the same frames end tens of pixels apart, and OpenCV "
            "offers no seed that changes this",
            "the size of the box never changes, and the target is sought within 25 pixels",
            "it has no score: NaN is reported",
            "start boxes are moved into the image, with sides of 5 pixels to 12 less than the "
            "image's: OpenCV stops with an error, or never returns, on others",
        ),
    )

    def make(self) -> Any:
        """A new tracker with OpenCV's default parameters."""
        import cv2

        return cv2.TrackerMIL.create()

    def start_box(self, image: Image, box: Box) -> tuple[int, int, int, int]:
        """The nearest box that OpenCV can start on.

        Raises:
            ArrayContract: the image is too small for any.
        """
        height, width = image.shape[:2]
        if min(width, height) < SMALLEST_SIDE + ROOM:
            least = SMALLEST_SIDE + ROOM
            msg = (
                f"{self.name} needs images of at least {least} pixels a side, not {width}x{height}"
            )
            raise ArrayContract(msg)
        x, y, box_width, box_height = integer_box(box, image)
        x, box_width = _fitted(x, box_width, width)
        y, box_height = _fitted(y, box_height, height)
        return x, y, box_width, box_height


def _fitted(start: int, size: int, limit: int) -> tuple[int, int]:
    """The part of one axis inside the image, brought to an allowed size around its middle."""
    low, high = max(0, start), min(limit, start + size)
    fitted = min(max(high - low, SMALLEST_SIDE), limit - ROOM)
    moved = low + (high - low - fitted) // 2
    return min(max(0, moved), limit - fitted - 2), fitted
