"""HighlightNet as an enhancer: options and weights around the network of `model`."""

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, ClassVar, cast

from nat2024.backends import ONNXRUNTIME_FIRST, Part
from nat2024.cards import read_card
from nat2024.interfaces import NeuralEnhancer
from nat2024.registry import register_enhancer
from nat2024_enhancers.highlightnet.settings import PRESETS, HighlightNetSettings

if TYPE_CHECKING:
    import torch

    from nat2024_enhancers.highlightnet.model import HighlightNet as Network


@register_enhancer("highlightnet")
class HighlightNet(NeuralEnhancer):
    """Raises the brightness of each pixel to a power that depends on it and on the whole image.

    `maps` gives `r` (N, 1, H, W, 0..1), the range mask; `level` (N, 2, 0..1), the two levels of
    each image; and `t` (N, 3, H, W), the enhanced image where the given one is nearly black, else
    0. Any size, nothing is padded.
    """

    card = read_card("nat2024_enhancers.highlightnet")
    can_replay = True
    fastest_backends = ONNXRUNTIME_FIRST
    training_settings = HighlightNetSettings()
    training_presets: ClassVar[Mapping[str, Mapping[str, Any]]] = PRESETS

    def __init__(self, *, detach_levels: bool = True, **base: Any) -> None:
        """Build the network and load its weights; `base` as in `NeuralEnhancer`.

        Args:
            detach_levels: whether the levels are constants when `.model` is trained, as in the
                official code, so that its Transformer is never trained; False trains it, as the
                paper means it. Enhanced images are the same.
            base: `weights`, `device`, `clamp`, `channel_order`, `quantise`.
        """
        self.detach_levels = detach_levels
        super().__init__(**base)

    def build(self) -> "Network":
        """The network, with the official checkpoint's 34 keys."""
        from nat2024_enhancers.highlightnet.model import HighlightNet as Network

        return Network(detach_levels=self.detach_levels)

    def forward(self, batch: "torch.Tensor") -> "torch.Tensor":
        """Enhance a batch; no clamp."""
        return cast("Network", self.model).enhance(batch)

    def parts(self) -> dict[str, Part]:
        """All but the levels, whose Transformer sees 256 tokens of any image."""
        return {"adjust": Part(cast("Network", self.model).adjust)}

    def forward_parts(
        self, parts: Mapping[str, Callable[..., Any]], batch: "torch.Tensor"
    ) -> "torch.Tensor":
        """Enhance a batch as `forward` does."""
        network = cast("Network", self.model)
        levels = network.levels(batch)
        return network.enhance_in_bands(batch, lambda band: parts["adjust"](band, levels))

    def forward_maps(self, batch: "torch.Tensor") -> "dict[str, torch.Tensor]":
        """The range mask, the levels and the brightened dark pixels of a batch."""
        network = cast("Network", self.model)
        _, mask, dark = network(batch)
        return {"r": mask, "level": network.levels(batch), "t": dark}

    def begin_training(self) -> None:
        """Draw the initial weights as the settings say."""
        from nat2024_enhancers.initial_weights import draw_normal_weights

        draw_normal_weights(self.model, self.training_settings.initial_spread)

    def loss(self, batch: "Mapping[str, Any]") -> "dict[str, torch.Tensor]":
        """The weighted terms of a batch's `image`, (N, 3, H, W) in 0..1."""
        from nat2024_enhancers.highlightnet.training import loss_terms

        return loss_terms(cast("Network", self.model), batch, self.training_settings)
