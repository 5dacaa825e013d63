"""The tone mapping of ADTrack: one global curve of the luminance for each image."""

import math
from typing import TYPE_CHECKING, Any, Literal

from nat2024.cards import Card
from nat2024.errors import InvalidOption
from nat2024.images import batch_to_image, check_batch, check_image, image_to_batch
from nat2024.interfaces import Enhancer
from nat2024.registry import register_enhancer
from nat2024.types import Image

if TYPE_CHECKING:
    import torch

_FLOOR = 0.001
"""Added to the luminance before its logarithm, as ADTrack does."""

_LUMINANCE = (0.299, 0.587, 0.114)


@register_enhancer("adtrack_tonemap")
class AdtrackTonemap(Enhancer):
    """Lights dark images up by the logarithm of their luminance, at no cost.

    With the luminance L = 0.299 R + 0.587 G + 0.114 B, its largest value Lmax and its log-average
    Lavg = exp(mean(log(0.001 + L))), every pixel's R, G and B are multiplied by Lg / L, where
    Lg = log(L / Lavg + 1) / log(Lmax / Lavg + 1). Values above 1 are cut off, which happens where
    a colour is saturated. A black image stays black. In a batch each image has its own curve.
    """

    card = Card(
        title="ADTrack tone mapping",
        summary="Multiplies colours by a logarithmic curve of the image's own luminance.",
        paper="B. Li, C. Fu, F. Ding, J. Ye, F. Lin: All-Day Object Tracking for Unmanned Aerial "
        "Vehicle. arXiv 2101.08446, 2021",
        code="https://github.com/vision4robotics/ADTrack_v2",
        code_licence="none stated",
        colour_order="batches are read as RGB, also those of trackers, which are BGR "
        "(channel_order=rgb turns them)",
        size_rule="any size",
        scopes=("patch", "frame"),
        differences=(
            "ADTrack decides on the first frame whether a sequence is dark and then maps every "
            "crop; only_dark=true decides for each image, the default maps all.",
        ),
    )

    def __init__(
        self,
        *,
        only_dark: bool = False,
        threshold: float = 0.148,
        channel_order: Literal["as_given", "rgb"] = "as_given",
        **base: Any,
    ) -> None:
        """Keep the settings.

        Args:
            only_dark: whether images pass unchanged whose log-average is not below `threshold`.
            threshold: ADTrack's limit of darkness, 0..1.
            channel_order: what `enhance_batch` reads: "as_given" as RGB, or "rgb" for batches that
                come in BGR and are turned before and after.
            base: `device`.

        Raises:
            InvalidOption: `threshold` is not in 0..1.
        """
        if not (math.isfinite(threshold) and 0 <= threshold <= 1):
            msg = f"adtrack_tonemap.threshold must be in 0..1, not {threshold}"
            raise InvalidOption(msg)
        super().__init__(**base)
        self.only_dark = only_dark
        self.threshold = threshold
        self.channel_order = channel_order

    def enhance(self, image: Image, *, bgr: bool = False) -> Image:
        """Map one uint8 (H, W, 3) image, rounded to nearest; `ArrayContract` where it is none."""
        batch = image_to_batch(check_image(image), self.device, reverse=bgr)
        return batch_to_image(self._map(batch), reverse=bgr)

    def enhance_batch(self, batch: "torch.Tensor") -> "torch.Tensor":
        """Map float32 (N, 3, H, W), without rounding to 8 bits.

        Raises:
            ArrayContract: `batch` is not float32 (N, 3, H, W).
        """
        check_batch(batch)
        batch = batch.to(self.device)
        if self.channel_order == "rgb":
            return self._map(batch.flip(1)).flip(1)
        return self._map(batch)

    def _map(self, batch: "torch.Tensor") -> "torch.Tensor":
        import torch

        with torch.no_grad():
            batch = batch.clamp(0.0, 1.0)
            weights = batch.new_tensor(_LUMINANCE).view(1, 3, 1, 1)
            luminance = (batch * weights).sum(dim=1, keepdim=True)
            average = (luminance + _FLOOR).log().mean(dim=(2, 3), keepdim=True).exp()
            largest = luminance.amax(dim=(2, 3), keepdim=True)
            # A black pixel has no colour to multiply, and a black image no largest luminance.
            tiny = torch.finfo(batch.dtype).tiny
            scale = (largest / average).log1p().clamp_min(tiny)
            gain = (luminance / average).log1p() / scale / luminance.clamp_min(tiny)
            mapped = (batch * gain).clamp(0.0, 1.0)
            if self.only_dark:
                mapped = torch.where(average < self.threshold, mapped, batch)
            return mapped
