"""DarkLighter as an enhancer: weights around the network of `model`."""

from typing import TYPE_CHECKING, cast

from nat2024.cards import read_card
from nat2024.interfaces import NeuralEnhancer
from nat2024.registry import register_enhancer

if TYPE_CHECKING:
    import torch

    from nat2024_enhancers.darklighter.model import DarkLighterNet


@register_enhancer("darklighter")
class DarkLighter(NeuralEnhancer):
    """Takes estimated noise away and lights up by estimated amounts, eight times.

    `maps` gives `r` (N, 8, H, W, 0..2), the factors of light, and `n` (N, 8, H, W, -1..1), the
    noise. Any size, nothing is padded.
    """

    card = read_card("nat2024_enhancers.darklighter")

    def build(self) -> "DarkLighterNet":
        """The network, with the official checkpoint's 14 keys."""
        from nat2024_enhancers.darklighter.model import DarkLighterNet

        return DarkLighterNet()

    def forward(self, batch: "torch.Tensor") -> "torch.Tensor":
        """Enhance a batch; no clamp."""
        return cast("DarkLighterNet", self.model).enhance(batch)

    def forward_maps(self, batch: "torch.Tensor") -> "dict[str, torch.Tensor]":
        """The light and noise maps of a batch."""
        _, light, noise = self.model(batch)
        return {"r": light, "n": noise}
