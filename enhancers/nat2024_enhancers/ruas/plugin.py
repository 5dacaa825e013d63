"""RUAS as an enhancer: options and weights around the network of `model`."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, ClassVar, Literal, cast

from nat2024.backends import TORCH_FIRST
from nat2024.cards import read_card
from nat2024.errors import WeightsMismatch
from nat2024.interfaces import NeuralEnhancer
from nat2024.registry import register_enhancer
from nat2024_enhancers.ruas.settings import PRESETS, RUASSettings

if TYPE_CHECKING:
    import torch

    from nat2024_enhancers.ruas.model import RUASNet

Variant = Literal["upe", "lol", "dark"]


@register_enhancer("ruas")
class RUAS(NeuralEnhancer):
    """Divides by an illumination that three searched cells estimate, one after the other.

    `maps` gives `u1`..`u3`, `t1`..`t3` (0..1) and `denoised` (not limited), each (N, 3, H, W),
    whatever the variant.
    """

    card = read_card("nat2024_enhancers.ruas")
    can_replay = True
    fastest_backends = TORCH_FIRST
    training_settings = RUASSettings()
    training_presets: ClassVar[Mapping[str, Mapping[str, Any]]] = PRESETS

    def __init__(self, *, variant: Variant = "upe", **base: Any) -> None:
        """Build the network and load its weights; `base` as in `NeuralEnhancer`.

        Args:
            variant: which of the three published models the weights are: "upe" and "dark" answer
                with u_3, "lol" with the denoised image, as the official test does. The names in
                the files do not tell; a published file of another variant is refused.
            base: `weights`, `device`, `clamp`, `channel_order`, `quantise`.

        Raises:
            WeightsMismatch: the weights are the published ones of another variant.
        """
        self.variant: Variant = variant
        super().__init__(**base)

    def build(self) -> "RUASNet":
        """The network, with the official checkpoint's keys."""
        from nat2024_enhancers.ruas.model import RUASNet

        self._check_variant()
        return RUASNet(denoise=self.variant == "lol")

    def forward(self, batch: "torch.Tensor") -> "torch.Tensor":
        """Enhance a batch; no clamp of the denoised image."""
        return cast("torch.Tensor", self.model(batch))

    def forward_maps(self, batch: "torch.Tensor") -> "dict[str, torch.Tensor]":
        """Images, illuminations and the denoised image of all stages."""
        return cast("RUASNet", self.model).maps(batch)

    def loss(self, batch: "Mapping[str, Any]") -> "dict[str, torch.Tensor]":
        """The weighted terms of a batch's `image`, (N, 3, H, W) in 0..1."""
        from nat2024_enhancers.ruas.training import loss_terms

        return loss_terms(cast("RUASNet", self.model), batch, self.training_settings)

    def _check_variant(self) -> None:
        digest = self.weights.sha256 if self.weights else ""
        file = self.card.published_file(digest)
        if self.weights and file and file.variant != self.variant:
            msg = (
                f"{self.weights.path}: this is {file.name}, RUAS's published weights for "
                f"variant={file.variant}, not {self.variant}; pass variant={file.variant} "
                f"(--opt ruas.variant={file.variant})"
            )
            raise WeightsMismatch(msg)
