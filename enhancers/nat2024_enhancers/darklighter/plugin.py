"""DarkLighter as an enhancer: weights around the network of `model`."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, ClassVar, cast

from nat2024.cards import read_card
from nat2024.interfaces import NeuralEnhancer
from nat2024.registry import register_enhancer
from nat2024_enhancers.darklighter.settings import PRESETS, DarkLighterSettings

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
    can_replay = True
    training_settings = DarkLighterSettings()
    training_note = "trained without the VGG term of the official loss, whose weights are not here"
    training_presets: ClassVar[Mapping[str, Mapping[str, Any]]] = PRESETS

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

    def begin_training(self) -> None:
        """Draw the initial weights as the settings say."""
        from nat2024_enhancers.initial_weights import draw_normal_weights

        draw_normal_weights(self.model, self.training_settings.initial_spread)

    def loss(self, batch: "Mapping[str, Any]") -> "dict[str, torch.Tensor]":
        """The weighted terms of a batch's `image`, (N, 3, H, W) in 0..1."""
        from nat2024_enhancers.darklighter.training import loss_terms

        return loss_terms(cast("DarkLighterNet", self.model), batch, self.training_settings)
