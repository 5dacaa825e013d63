"""SCT as an enhancer: options and weights around the network of `model`."""

from typing import TYPE_CHECKING, Any, Literal, cast

from nat2024.backends import ONNXRUNTIME_FIRST
from nat2024.cards import read_card
from nat2024.interfaces import NeuralEnhancer
from nat2024.registry import register_enhancer

if TYPE_CHECKING:
    import torch

    from nat2024_enhancers.sct.model import SCTNet


@register_enhancer("sct")
class SCT(NeuralEnhancer):
    """Bends every pixel by curves that a transformer estimates from a 112x112 copy of the image.

    `maps` gives `conv10_full_128` (N, 6, 128, 128), the estimated maps with their border, and
    `x_r`, `x_n` (N, 3, H, W), the curve and the noise maps at the size of the image, all -1..1.
    """

    card = read_card("nat2024_enhancers.sct")
    can_replay = True
    fastest_backends = ONNXRUNTIME_FIRST

    def __init__(self, *, statistics: Literal["running", "image"] = "running", **base: Any) -> None:
        """Build the network and load its weights; `base` as in `NeuralEnhancer`.

        Args:
            statistics: by what the BatchNorms normalise: "running" averages of the training, or
                each "image" by its own mean and variance, as SCT's own tracker script does, which
                leaves its network in training mode (its random stochastic depth is left out here).
            base: `weights`, `device`, `clamp`, `channel_order`, `quantise`.
        """
        self.statistics: Literal["running", "image"] = statistics
        super().__init__(**base)

    def build(self) -> "SCTNet":
        """The network, with the official checkpoint's keys."""
        from nat2024_enhancers.sct.model import SCTNet

        return SCTNet(statistics=self.statistics)

    def forward(self, batch: "torch.Tensor") -> "torch.Tensor":
        """Enhance a batch; no clamp."""
        return cast("torch.Tensor", self.model(batch))

    def forward_maps(self, batch: "torch.Tensor") -> "dict[str, torch.Tensor]":
        """The estimated maps, as they are and at the size of the image."""
        return cast("SCTNet", self.model).maps(batch)
