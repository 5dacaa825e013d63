"""LDEnhancer as an enhancer: sizes, options and weights around the network of `model`."""

from typing import TYPE_CHECKING, Any, Literal, cast

from nat2024.cards import read_card
from nat2024.errors import InvalidOption
from nat2024.interfaces import NeuralEnhancer
from nat2024.registry import register_enhancer

if TYPE_CHECKING:
    import torch

    from nat2024_enhancers.ldenhancer.model import LDEnhancerNet


@register_enhancer("ldenhancer")
class LDEnhancer(NeuralEnhancer):
    """Suppresses the light distribution of night images before a daytime tracker sees them.

    `maps` gives `F0`, `F1`, `M` (N, 8, H / 16, W / 16), `O1`, `O2` (N, 3, H, W, 0 or more) and
    `P_S`, `P_E`, `A` (N, 3 * iterations, H, W, -1..1 and for A -2..2), H and W padded. Sides above
    8000 pixels raise `ArrayContract`: the network knows 500 positions each way.
    """

    card = read_card("nat2024_enhancers.ldenhancer")
    stride = 16

    def __init__(
        self,
        *,
        pad_multiple: Literal[8, 16] = 16,
        iteration_sign: Literal["code", "paper"] = "code",
        iterations: int = 4,
        **base: Any,
    ) -> None:
        """Build the network and load its weights; `base` as in `NeuralEnhancer`.

        Args:
            pad_multiple: sides are padded up to a multiple of this. The official code pads to 8,
                though its network needs 16; with 8 an image fails where it fails there, with
                `ArrayContract`, and gives the same numbers elsewhere.
            iteration_sign: "code" adds A (x^2 - x) as the official code does, "paper" adds
                A x (1 - x) as the paper writes; official weights need "code".
            iterations: how often the curves are applied; the official weights are for 4.
            base: `weights`, `device`, `clamp`, `channel_order`.
        """
        if iterations < 1:
            msg = f"ldenhancer.iterations must be at least 1, not {iterations}"
            raise InvalidOption(msg)
        self.iterations = iterations
        self.iteration_sign: Literal["code", "paper"] = iteration_sign
        self.stride = pad_multiple
        super().__init__(**base)

    def build(self) -> "LDEnhancerNet":
        """The network, with the official checkpoint's 120 keys."""
        from nat2024_enhancers.ldenhancer.model import LDEnhancerNet

        return LDEnhancerNet(iterations=self.iterations, iteration_sign=self.iteration_sign)

    def forward(self, batch: "torch.Tensor") -> "torch.Tensor":
        """Enhance a padded batch; no clamp."""
        return cast("LDEnhancerNet", self.model).enhance(batch)

    def forward_maps(self, batch: "torch.Tensor") -> "dict[str, torch.Tensor]":
        """All intermediate maps of a padded batch."""
        return cast("LDEnhancerNet", self.model).maps(batch)
