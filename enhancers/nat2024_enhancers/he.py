"""Histogram equalisation of the luminance, with OpenCV."""

from typing import TYPE_CHECKING, Any, Literal

from nat2024.cards import Card
from nat2024.images import check_batch, check_image
from nat2024.interfaces import Enhancer
from nat2024.registry import register_enhancer
from nat2024.types import Image

if TYPE_CHECKING:
    import torch


@register_enhancer("he")
class HistogramEqualisation(Enhancer):
    """Equalises the histogram of Y of YCrCb (ITU-R BT.601) over the image; Cr and Cb stay.

    Luminance weighs red, green and blue differently, so the colour order matters. `enhance` knows
    it; `enhance_batch` reads channels in the order given as RGB, also the BGR crops of trackers,
    unless `channel_order="rgb"` turns batches that come in BGR before and after.
    """

    card = Card(
        title="Histogram equalisation",
        summary="Equalises the histogram of the luminance over the whole image.",
        code="https://github.com/opencv/opencv",
        code_licence="Apache-2.0",
        colour_order="batches are read as RGB, also those of trackers, which are BGR "
        "(channel_order=rgb turns them)",
        size_rule="any size",
    )

    def __init__(
        self, *, channel_order: Literal["as_given", "rgb"] = "as_given", **base: Any
    ) -> None:
        """Keep the settings.

        Args:
            channel_order: what `enhance_batch` reads: "as_given" as RGB, or "rgb" for batches that
                come in BGR and are turned before and after.
            base: `device`.
        """
        super().__init__(**base)
        self.channel_order = channel_order

    def enhance(self, image: Image, *, bgr: bool = False) -> Image:
        """Equalise one uint8 (H, W, 3) image; `ArrayContract` where it is none."""
        import cv2

        to_luma, from_luma = (
            (cv2.COLOR_BGR2YCrCb, cv2.COLOR_YCrCb2BGR)
            if bgr
            else (cv2.COLOR_RGB2YCrCb, cv2.COLOR_YCrCb2RGB)
        )
        luma = cv2.cvtColor(check_image(image), to_luma)
        luma[..., 0] = cv2.equalizeHist(luma[..., 0])
        return check_image(cv2.cvtColor(luma, from_luma))

    def enhance_batch(self, batch: "torch.Tensor") -> "torch.Tensor":
        """Equalise float32 (N, 3, H, W), rounded to 8 bits as the method works on 8-bit images.

        Raises:
            ArrayContract: `batch` is not float32 (N, 3, H, W).
        """
        check_batch(batch)
        if self.channel_order == "rgb":
            return super().enhance_batch(batch.flip(1)).flip(1)
        return super().enhance_batch(batch)
