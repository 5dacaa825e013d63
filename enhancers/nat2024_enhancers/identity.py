"""The enhancer that changes nothing: the plain tracker under the name of a pair."""

from typing import TYPE_CHECKING

from nat2024.cards import Card
from nat2024.images import check_batch, check_image
from nat2024.interfaces import Enhancer
from nat2024.registry import register_enhancer
from nat2024.types import Image

if TYPE_CHECKING:
    import torch


@register_enhancer("none")
class Identity(Enhancer):
    """Gives a copy of what it gets."""

    card = Card(
        title="none",
        summary="Leaves images as they are.",
        colour_order="any",
        size_rule="any size",
    )

    def enhance(self, image: Image, *, bgr: bool = False) -> Image:  # noqa: ARG002 (any order)
        """Copy a uint8 (H, W, 3) image; `ArrayContract` where it is none."""
        return check_image(image).copy(order="C")

    def enhance_batch(self, batch: "torch.Tensor") -> "torch.Tensor":
        """Copy a float32 (N, 3, H, W) batch; `ArrayContract` where it is none."""
        check_batch(batch)
        return batch.to(self.device, copy=True)
