"""LLVE as an enhancer: sizes and weights around the network of `model`."""

from typing import TYPE_CHECKING, ClassVar, Literal, cast

from nat2024.backends import TORCH_FIRST
from nat2024.cards import read_card
from nat2024.interfaces import NeuralEnhancer
from nat2024.registry import register_enhancer

if TYPE_CHECKING:
    import torch

    from nat2024_enhancers.llve.model import LLVENet


@register_enhancer("llve")
class LLVE(NeuralEnhancer):
    """A U-Net that enhances single frames and was trained to be steady from frame to frame.

    The authors train and test it on BGR images, so `enhance` feeds BGR, as trackers do.
    """

    card = read_card("nat2024_enhancers.llve")
    can_replay = True
    fastest_backends = TORCH_FIRST
    image_order: ClassVar[Literal["rgb", "bgr"]] = "bgr"

    def build(self) -> "LLVENet":
        """The network, with the official checkpoint's keys."""
        from nat2024_enhancers.llve.model import LLVENet

        return LLVENet()

    def pad(self, batch: "torch.Tensor") -> "tuple[torch.Tensor, int, int]":
        """Fill up sides below 16 by replication; all others are taken as they are."""
        import torch.nn.functional as F

        from nat2024_enhancers.llve.model import SMALLEST

        rows, columns = (max(SMALLEST - side, 0) for side in batch.shape[-2:])
        if rows or columns:
            batch = F.pad(batch, (0, columns, 0, rows), mode="replicate")
        return batch, 0, 0

    def forward(self, batch: "torch.Tensor") -> "torch.Tensor":
        """Enhance a batch whose sides are at least 16; no clamp."""
        return cast("torch.Tensor", self.model(batch))
