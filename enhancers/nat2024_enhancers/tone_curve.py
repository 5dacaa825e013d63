"""A fixed tone curve per channel: the honest baseline beside any network."""

from typing import TYPE_CHECKING, Any, Literal

from nat2024.backends import TORCH_FIRST
from nat2024.cards import Card
from nat2024.interfaces import NeuralEnhancer
from nat2024.registry import register_enhancer

if TYPE_CHECKING:
    import torch


@register_enhancer("tone_curve")
class ToneCurve(NeuralEnhancer):
    """Looks every value up in a curve of 256 points, linear between them; 0..1 is the domain.

    Channels are fed in the order given, like to any network, and curve k belongs to channel k as
    it is fed: R, G, B in `enhance`, and B, G, R where a tracker feeds its BGR crops. A curve that
    was fitted to a network therefore does to a tracker's crops what the network does to them,
    with its first curve on blue. `channel_order="rgb"` turns batches that come in BGR.

    Weights are one entry, `curve`, float32 (3, 256): what the levels 0/255 .. 255/255 become.
    `nat-bench enhance --fit-curve FILE` or `nat2024.zoo.curve_files.write_tone_curve` writes them.
    `weights=False` is the identity. `image_order="bgr"` is for curves of enhancers that see BGR
    even in `enhance`.
    """

    card = Card(
        title="Tone curve",
        summary="Looks every value up in one fixed curve for each channel.",
        needs_weights=True,
        keys=("curve (3, 256)",),
        colour_order="as fed: R, G, B of images, B, G, R of trackers' crops "
        "(channel_order=rgb turns them)",
        size_rule="any size",
        state="weights are fitted: nat-bench enhance --fit-curve FILE.safetensors",
    )

    fastest_backends = TORCH_FIRST

    def __init__(self, *, image_order: Literal["rgb", "bgr"] = "rgb", **base: Any) -> None:
        """Load the curve; `base` as in `NeuralEnhancer`.

        Args:
            image_order: order in which `enhance` feeds the channels of images to the curves.
            base: `weights`, `device`, `clamp`, `channel_order`, `quantise`.
        """
        super().__init__(**base)
        self.image_order = image_order  # type: ignore[misc]

    def build(self) -> "torch.nn.Module":
        """A module whose one buffer `curve` is the identity."""
        from torch import linspace, nn

        model = nn.Module()
        model.register_buffer("curve", linspace(0.0, 1.0, 256).repeat(3, 1))
        return model

    def forward(self, batch: "torch.Tensor") -> "torch.Tensor":
        """Look every value up; values beyond 0..1 count as 0 or 1, NaN stays NaN."""
        import torch

        curve: torch.Tensor = self.model.get_buffer("curve")
        last = curve.shape[1] - 1
        places = batch.clamp(0.0, 1.0) * last
        lower = places.nan_to_num(0.0).floor_().clamp_(max=last - 1)
        rows = torch.arange(3, device=batch.device).view(1, 3, 1, 1) * curve.shape[1]
        index = lower.long() + rows
        table = curve.flatten()
        return torch.lerp(table[index], table[index + 1], places - lower)
