"""Gamma correction, the simplest way to light an image up."""

import math
from typing import TYPE_CHECKING, Any

from nat2024.cards import Card
from nat2024.errors import InvalidOption
from nat2024.images import check_batch
from nat2024.interfaces import Enhancer
from nat2024.registry import register_enhancer

if TYPE_CHECKING:
    import torch


@register_enhancer("gamma")
class Gamma(Enhancer):
    """Raises every value in 0..1 to the power `gamma`: below 1 brightens, above 1 darkens."""

    card = Card(
        title="Gamma correction",
        summary="Raises every value in 0..1 to one power.",
        colour_order="any",
        size_rule="any size",
    )

    def __init__(self, *, gamma: float = 0.5, **base: Any) -> None:
        """Keep the power.

        Args:
            gamma: above 0; 1 changes nothing.
            base: `device`.

        Raises:
            InvalidOption: `gamma` is not a finite number above 0.
        """
        if not (math.isfinite(gamma) and gamma > 0):
            msg = f"gamma.gamma must be a finite number above 0, not {gamma}"
            raise InvalidOption(msg)
        super().__init__(**base)
        self.gamma = gamma

    def enhance_batch(self, batch: "torch.Tensor") -> "torch.Tensor":
        """Apply the power to float32 (N, 3, H, W), without rounding to 8 bits.

        Raises:
            ArrayContract: `batch` is not float32 (N, 3, H, W).
        """
        check_batch(batch)
        return batch.to(self.device).clamp(0.0, 1.0).pow(self.gamma)
