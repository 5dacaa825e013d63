"""DCE++ as an enhancer: sizes, options and weights around the network of `model`."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, ClassVar, Literal, cast

from nat2024.backends import ONNXRUNTIME_FIRST
from nat2024.cards import read_card
from nat2024.errors import ArrayContract, InvalidOption
from nat2024.interfaces import NeuralEnhancer
from nat2024.registry import register_enhancer
from nat2024_enhancers.dcepp.settings import PRESETS, DCEppSettings

if TYPE_CHECKING:
    import torch

    from nat2024_enhancers.dcepp.model import DCEppNet


@register_enhancer("dcepp")
class DCEpp(NeuralEnhancer):
    """Lights every pixel up along a curve whose parameters a small network estimates.

    `maps` gives `x_r` (N, 3, H, W, -1..1), the curve parameters, H and W padded (or cut).
    """

    card = read_card("nat2024_enhancers.dcepp")
    can_replay = True
    fastest_backends = ONNXRUNTIME_FIRST
    training_settings = DCEppSettings()
    training_presets: ClassVar[Mapping[str, Mapping[str, Any]]] = PRESETS

    def __init__(
        self,
        *,
        scale_factor: int = 12,
        size_rule: Literal["pad", "crop"] = "pad",
        **base: Any,
    ) -> None:
        """Build the network and load its weights; `base` as in `NeuralEnhancer`.

        Args:
            scale_factor: how much smaller the image is that the convolutions see, as at test time
                in the official code; its training script has 1. The same weights serve all.
            size_rule: "pad" fills sides up to multiples of `scale_factor` by reflection and cuts
                back, as the authors' trackers do; "crop" cuts right and bottom off, as the
                authors' stand-alone test does: answers are smaller than the image then, and
                images smaller than `scale_factor` are refused with `ArrayContract`.
            base: `weights`, `device`, `clamp`, `channel_order`, `quantise`.

        Raises:
            InvalidOption: the scale factor is below 1.
        """
        if scale_factor < 1:
            msg = f"dcepp.scale_factor must be at least 1, not {scale_factor}"
            raise InvalidOption(msg)
        self.scale_factor = scale_factor
        self.size_rule = size_rule
        self.stride = scale_factor
        super().__init__(**base)

    def build(self) -> "DCEppNet":
        """The network, with the official checkpoint's 28 keys."""
        from nat2024_enhancers.dcepp.model import DCEppNet

        return DCEppNet(scale_factor=self.scale_factor)

    def pad(self, batch: "torch.Tensor") -> "tuple[torch.Tensor, int, int]":
        """Pad, or cut, to multiples of the scale factor; see `NeuralEnhancer.pad`."""
        if self.size_rule == "pad":
            return super().pad(batch)
        height, width = batch.shape[-2:]
        if min(height, width) < self.stride:
            msg = (
                f"dcepp with size_rule=crop and scale_factor={self.stride} takes images of at "
                f"least {self.stride} pixels a side, not {width}x{height}; size_rule=pad takes any"
            )
            raise ArrayContract(msg)
        rows, columns = height - height % self.stride, width - width % self.stride
        return batch[..., :rows, :columns].contiguous(), 0, 0

    def forward(self, batch: "torch.Tensor") -> "torch.Tensor":
        """Enhance a padded batch; no clamp."""
        return cast("DCEppNet", self.model).enhance(batch)

    def forward_maps(self, batch: "torch.Tensor") -> "dict[str, torch.Tensor]":
        """The curve parameters of a padded batch."""
        return {"x_r": self.model(batch)[1]}

    def loss(self, batch: "Mapping[str, Any]") -> "dict[str, torch.Tensor]":
        """The weighted terms of a batch's `image`, (N, 3, H, W) in 0..1."""
        from nat2024_enhancers.dcepp.training import loss_terms

        return loss_terms(cast("DCEppNet", self.model), batch, self.training_settings)
