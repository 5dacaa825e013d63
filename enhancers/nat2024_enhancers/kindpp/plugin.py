"""KinD++ as an enhancer: sizes, options and weights around the networks of `model`."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, cast

from nat2024.backends import TORCH_FIRST
from nat2024.cards import read_card
from nat2024.errors import ArrayContract, InvalidOption
from nat2024.interfaces import NeuralEnhancer
from nat2024.registry import register_enhancer

if TYPE_CHECKING:
    import torch

    from nat2024.zoo import StateDict
    from nat2024_enhancers.kindpp.model import KindPlusPlusNet


@register_enhancer("kindpp")
class KindPlusPlus(NeuralEnhancer):
    """Restores the reflectance of a dark image and blends it with the image where that is bright.

    Each image is first stretched so that its values fill 0..1. `maps` gives, of that image, `R`
    and `restored` (N, 3, H, W), `I`, `low_i` and `adjusted_I` (N, 1, H, W), all in 0..1, H and W
    padded (or cut).
    """

    card = read_card("nat2024_enhancers.kindpp")
    fastest_backends = TORCH_FIRST
    stride = 4

    def __init__(
        self,
        *,
        adjustment: bool = False,
        ratio: float = 5.0,
        size_rule: Literal["pad", "crop"] = "pad",
        **base: Any,
    ) -> None:
        """Build the networks and load their weights; `base` as in `NeuralEnhancer`.

        Args:
            adjustment: whether the third network adjusts the illumination of what is restored;
                the official evaluation leaves it out.
            ratio: how much brighter the illumination shall become with `adjustment`, and in
                `maps`.
            size_rule: "pad" fills sides up to multiples of 4 by reflection and cuts back; "crop"
                cuts right and bottom off, as the official code does: answers are smaller than the
                image then, and images below 4 pixels a side are refused with `ArrayContract`.
            base: `weights`, `device`, `clamp`, `channel_order`, `quantise`. `weights` may be a
                folder of TensorFlow checkpoints or a `.npz` file as well, see `convert`.

        Raises:
            InvalidOption: the ratio is not a finite number above 0.
        """
        if not (math.isfinite(ratio) and ratio > 0):
            msg = f"kindpp.ratio must be a finite number above 0, not {ratio}"
            raise InvalidOption(msg)
        self.adjustment = adjustment
        self.ratio = ratio
        self.size_rule = size_rule
        super().__init__(**base)

    def build(self) -> "KindPlusPlusNet":
        """The three networks, with keys named after the official TensorFlow variables."""
        from nat2024_enhancers.kindpp.model import KindPlusPlusNet

        return KindPlusPlusNet()

    def read_state(self, path: Path) -> "StateDict":
        """Read weights in all published forms; see `convert.read_kindpp`."""
        from nat2024_enhancers.kindpp.convert import read_kindpp

        return read_kindpp(path)

    def pad(self, batch: "torch.Tensor") -> "tuple[torch.Tensor, int, int]":
        """Stretch each image to 0..1, then pad, or cut, to multiples of 4."""
        from nat2024_enhancers.kindpp.model import normalise

        # before cutting, as in the official code: what is cut off counts for the range
        stretched = normalise(batch)
        if self.size_rule == "pad":
            return super().pad(stretched)
        height, width = batch.shape[-2:]
        if min(height, width) < self.stride:
            msg = (
                f"kindpp with size_rule=crop takes images of at least {self.stride} pixels a side, "
                f"not {width}x{height}; size_rule=pad takes any"
            )
            raise ArrayContract(msg)
        rows, columns = height - height % self.stride, width - width % self.stride
        return stretched[..., :rows, :columns].contiguous(), 0, 0

    def forward(self, batch: "torch.Tensor") -> "torch.Tensor":
        """Enhance a stretched and padded batch; no clamp."""
        enhanced: torch.Tensor = self.model(batch, self.ratio if self.adjustment else None)
        return enhanced

    def forward_maps(self, batch: "torch.Tensor") -> "dict[str, torch.Tensor]":
        """All intermediate maps of a stretched and padded batch."""
        return cast("KindPlusPlusNet", self.model).maps(batch, self.ratio)
