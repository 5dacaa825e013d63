"""EnlightenGAN as an enhancer: weights around the network of `model`."""

from typing import TYPE_CHECKING, cast

from nat2024.backends import TORCH_FIRST
from nat2024.cards import read_card
from nat2024.interfaces import NeuralEnhancer
from nat2024.registry import register_enhancer

if TYPE_CHECKING:
    import torch

    from nat2024_enhancers.enlightengan.model import EnlightenGANNet


@register_enhancer("enlightengan")
class EnlightenGAN(NeuralEnhancer):
    """A generator that adds most where the image is dark, trained without pairs of images.

    Padding and, above 2200 columns, halving happen inside the network, as in the official code.
    `maps` gives `gray` (N, 1, H, W), the attention map 0..1, and `latent` and `output` (N, 3, H, W)
    on the network's scale of -1..1, all without padding, of half size above 2200 columns.
    """

    card = read_card("nat2024_enhancers.enlightengan")
    can_replay = True
    fastest_backends = TORCH_FIRST

    def build(self) -> "EnlightenGANNet":
        """The network, with the official checkpoint's keys."""
        from nat2024_enhancers.enlightengan.model import EnlightenGANNet

        return EnlightenGANNet()

    def forward(self, batch: "torch.Tensor") -> "torch.Tensor":
        """Enhance a batch; no clamp."""
        return cast("torch.Tensor", self.model(batch))

    def forward_maps(self, batch: "torch.Tensor") -> "dict[str, torch.Tensor]":
        """Attention map, what is added, and the sum."""
        return cast("EnlightenGANNet", self.model).maps(batch)
