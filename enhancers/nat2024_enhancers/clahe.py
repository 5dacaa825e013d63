"""Contrast limited adaptive histogram equalisation of the lightness, with OpenCV."""

import math
from typing import TYPE_CHECKING, Any, Literal

from nat2024.cards import Card
from nat2024.errors import InvalidOption
from nat2024.images import check_batch, check_image
from nat2024.interfaces import Enhancer
from nat2024.registry import register_enhancer
from nat2024.types import Image

if TYPE_CHECKING:
    import torch


@register_enhancer("clahe")
class Clahe(Enhancer):
    """Equalises the histogram of L of CIE Lab in tiles, blended bilinearly; a and b stay.

    Lightness weighs red, green and blue differently, so the colour order matters. `enhance` knows
    it. `enhance_batch` cannot know it and takes channels in the order given, like every enhancer:
    it reads them as RGB, and a BGR crop of a tracker gets a lightness whose weights of red and
    blue are swapped. `channel_order="rgb"` turns batches that come in BGR before and after, which
    gives a tracker's crops the same lightness as `enhance(crop, bgr=True)`.
    """

    card = Card(
        title="CLAHE",
        summary="Equalises the lightness in tiles with limited contrast.",
        paper="Karel Zuiderveld: Contrast Limited Adaptive Histogram Equalization. "
        "Graphics Gems IV, 1994",
        code="https://github.com/opencv/opencv",
        code_licence="Apache-2.0",
        colour_order="batches are read as RGB, also those of trackers, which are BGR "
        "(channel_order=rgb turns them)",
        size_rule="any size",
    )

    def __init__(
        self,
        *,
        clip_limit: float = 2.0,
        tiles: int = 8,
        channel_order: Literal["as_given", "rgb"] = "as_given",
        **base: Any,
    ) -> None:
        """Keep the settings.

        Args:
            clip_limit: how many times the mean height a bar of a tile's histogram may reach.
            tiles: number of tiles along each side.
            channel_order: what `enhance_batch` reads: "as_given" as RGB, or "rgb" for batches that
                come in BGR and are turned before and after.
            base: `device`.

        Raises:
            InvalidOption: `clip_limit` is not a finite number above 0, or there is no tile.
        """
        if not (math.isfinite(clip_limit) and clip_limit > 0):
            msg = f"clahe.clip_limit must be a finite number above 0, not {clip_limit}"
            raise InvalidOption(msg)
        if tiles < 1:
            msg = f"clahe.tiles must be at least 1, not {tiles}"
            raise InvalidOption(msg)
        super().__init__(**base)
        self.clip_limit = clip_limit
        self.tiles = tiles
        self.channel_order = channel_order

    def enhance(self, image: Image, *, bgr: bool = False) -> Image:
        """Equalise one uint8 (H, W, 3) image; `ArrayContract` where it is none."""
        import cv2

        to_lab, from_lab = (
            (cv2.COLOR_BGR2Lab, cv2.COLOR_Lab2BGR)
            if bgr
            else (cv2.COLOR_RGB2Lab, cv2.COLOR_Lab2RGB)
        )
        lab = cv2.cvtColor(check_image(image), to_lab)
        equaliser = cv2.createCLAHE(self.clip_limit, (self.tiles, self.tiles))
        lab[..., 0] = equaliser.apply(lab[..., 0])
        return check_image(cv2.cvtColor(lab, from_lab))

    def enhance_batch(self, batch: "torch.Tensor") -> "torch.Tensor":
        """Equalise float32 (N, 3, H, W), rounded to 8 bits as the method works on 8-bit images.

        Raises:
            ArrayContract: `batch` is not float32 (N, 3, H, W).
        """
        check_batch(batch)
        if self.channel_order == "rgb":
            return super().enhance_batch(batch.flip(1)).flip(1)
        return super().enhance_batch(batch)
