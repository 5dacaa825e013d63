"""HighlightNet as an enhancer: options and weights around the network of `model`."""

from typing import TYPE_CHECKING, Any, cast

from nat2024.cards import read_card
from nat2024.interfaces import NeuralEnhancer
from nat2024.registry import register_enhancer

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

    def forward_maps(self, batch: "torch.Tensor") -> "dict[str, torch.Tensor]":
        """The range mask, the levels and the brightened dark pixels of a batch."""
        network = cast("Network", self.model)
        _, mask, dark = network(batch)
        return {"r": mask, "level": network.levels(batch), "t": dark}
