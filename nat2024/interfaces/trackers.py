"""What a tracker is: started on a box, it gives one box and one score a frame."""

from abc import ABC, abstractmethod
from typing import Any, ClassVar, Literal, TypeAlias

import numpy as np

from nat2024.cards import Card
from nat2024.devices import check_device
from nat2024.errors import ArrayContract, InvalidOption, UsageError
from nat2024.images import check_image
from nat2024.interfaces.enhancers import BatchEnhancer, enhance_frame
from nat2024.types import Box, Image
from nat2024.zoo import Weights

Scope: TypeAlias = Literal["patch", "frame"]
"""What is enhanced: the tracker's template and search crops, or the whole frame."""


class Tracker(ABC):
    """A single-object tracker. Write `start` and `advance`.

    Attributes:
        name: registered name, set by `register_tracker`.
        card: what it is and whose work it is; `card.scopes` says which scopes it can do.
        enhancer: applied to the crops or to the frame, None for the plain tracker.
        scope: "patch" or "frame".
        weights: what it was created with, None for methods without weights.
    """

    name: ClassVar[str] = ""
    card: ClassVar[Card]
    weights: Weights | None = None
    _has_started: bool = False

    def __init__(
        self,
        *,
        enhancer: BatchEnhancer | None = None,
        device: str = "cpu",
        scope: Scope | None = None,
    ) -> None:
        """Keep what all trackers share.

        Args:
            enhancer: anything with `enhance_batch`.
            device: where networks run.
            scope: what is enhanced; None takes the tracker's own default, the card's first.

        Raises:
            InvalidOption: the tracker cannot do that scope.
        """
        self.scope: Scope = scope or self.card.scopes[0]
        if self.scope not in self.card.scopes:
            msg = f"{self.name} takes only scope={' or '.join(self.card.scopes)}, not {scope}"
            raise InvalidOption(msg)
        self.enhancer = enhancer
        self.device = check_device(device)

    def init(self, image: Image, box: Any) -> Box:
        """Start on a frame.

        Args:
            image: uint8 (H, W, 3) BGR.
            box: x, y, w, h as annotated, 0-based pixels, floats allowed.

        Returns:
            The float64 (4,) box that results hold as row 0.

        Raises:
            ArrayContract: the image is no image, or the box is not four finite numbers with a
                size above zero that touch the image.
        """
        check_image(image)
        self._has_started = False
        row = self.start(self._enhance_frame(image), check_start_box(box, image))
        self._has_started = True
        return row

    def update(self, image: Image) -> tuple[Box, float]:
        """Follow the target into the next frame, uint8 (H, W, 3) BGR; gives (box, score).

        Raises:
            ArrayContract: the image is no image.
            UsageError: there was no `init`, or it failed.
        """
        if not self._has_started:
            msg = f"{self.name}: update before init; call init(image, box) on the first frame"
            raise UsageError(msg)
        return self.advance(self._enhance_frame(check_image(image)))

    @abstractmethod
    def start(self, image: Image, box: Box) -> Box:
        """Forget everything and start on this (already frame-enhanced) image; see `init`."""

    @abstractmethod
    def advance(self, image: Image) -> tuple[Box, float]:
        """Follow into this (already frame-enhanced) image; see `update`."""

    def _enhance_frame(self, image: Image) -> Image:
        if self.enhancer is None or self.scope != "frame":
            return image
        return enhance_frame(self.enhancer, image, self.device)


def check_start_box(box: Any, image: Image) -> Box:
    """Return the box as float64 (4,) if a tracker can start on it, else raise `ArrayContract`."""
    try:
        start = np.array(box, dtype=np.float64).reshape(-1)
    except (TypeError, ValueError):
        start = np.empty(0)
    height, width = image.shape[:2]
    if start.shape != (4,) or not np.isfinite(start).all():
        told = box.tolist() if isinstance(box, np.ndarray) else box
        msg = f"start box must be four finite numbers x, y, w, h, not {told!r:.60}"
        raise ArrayContract(msg)
    x, y, w, h = start
    if w <= 0 or h <= 0:
        msg = f"start box {start.tolist()} has no area; width and height must be above 0"
        raise ArrayContract(msg)
    if x >= width or y >= height or x + w <= 0 or y + h <= 0:
        msg = f"start box {start.tolist()} lies outside the {width}x{height} image"
        raise ArrayContract(msg)
    return start
