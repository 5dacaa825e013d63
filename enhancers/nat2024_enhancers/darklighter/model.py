"""The network of DarkLighter (Ye et al., IROS 2021), symbols as in the official code.

A network estimates eight maps r of light and eight maps n of noise, shared by the three colours;
with each pair the image is changed once: x <- (x - n_k) r_k, where r_k = tanh(.) + 1.

Images are float32 (N, 3, H, W) of any size. Names of modules are those of the official state dict.
"""

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from nat2024.networks.bands import run_in_bands
from nat2024.networks.convolving import convolve_pair

_FEATURES = 32
_STEPS = 8
_HALO = 6  # six 3x3 convolutions one after the other
# Features of this many pixels and the halo stay below 32 MB, where allocations begin to cost.
_BAND = 3 << 16


class DarkLighterNet(nn.Module):
    """DarkLighter for images of any size; there is no `e_conv6`, as in the official code."""

    def __init__(self) -> None:
        super().__init__()
        self.e_conv1 = nn.Conv2d(3, _FEATURES, 3, padding=1)
        self.e_conv2 = nn.Conv2d(_FEATURES, _FEATURES, 3, padding=1)
        self.e_conv3 = nn.Conv2d(2 * _FEATURES, _FEATURES, 3, padding=1)
        self.e_conv4 = nn.Conv2d(2 * _FEATURES, _FEATURES, 3, padding=1)
        self.e_conv5 = nn.Conv2d(2 * _FEATURES, _FEATURES, 3, padding=1)
        self.e_conv7 = nn.Conv2d(2 * _FEATURES, _STEPS, 3, padding=1)
        self.e_conv8 = nn.Conv2d(2 * _FEATURES, _STEPS, 3, padding=1)

    def forward(self, image: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Enhance images.

        Returns:
            The enhanced images (N, 3, H, W), not clamped (values above 3 occur); the light maps
            r (N, 8, H, W, 0..2); and the noise maps n (N, 8, H, W, -1..1).
        """
        light, noise = self._estimate(image)
        return _adjust(image, light, noise), light, noise

    def enhance(self, image: Tensor) -> Tensor:
        """The enhanced images of `forward` alone, with memory that does not grow with them."""
        return run_in_bands(lambda band: self(band)[0], image, halo=_HALO, pixels=_BAND)

    def _estimate(self, image: Tensor) -> tuple[Tensor, Tensor]:
        # On a CPU convolutions are faster channels-last.
        x1 = F.relu_(self.e_conv1(image.contiguous(memory_format=torch.channels_last)))
        x2 = F.relu_(self.e_conv2(x1))
        x3 = F.relu_(convolve_pair(self.e_conv3, x1, x2))
        x4 = F.relu_(convolve_pair(self.e_conv4, x2, x3))
        x5 = F.relu_(convolve_pair(self.e_conv5, x3, x4))
        # One convolution for both maps: eight outputs alone would half fill the processor's lanes.
        weight = torch.cat([self.e_conv7.weight, self.e_conv8.weight])
        assert self.e_conv7.bias is not None
        assert self.e_conv8.bias is not None
        bias = torch.cat([self.e_conv7.bias, self.e_conv8.bias])
        of_x4, of_x5 = weight.chunk(2, dim=1)
        both = F.conv2d(x4, of_x4, bias, padding=1).add_(F.conv2d(x5, of_x5, padding=1))
        light, noise = torch.tanh(both.contiguous()).chunk(2, dim=1)
        return light + 1, noise


def _adjust(image: Tensor, light: Tensor, noise: Tensor) -> Tensor:
    # All steps together are x * scale - shift with the same scale and shift for every colour.
    scale, *gains = light.unbind(dim=1)
    first, *offsets = noise.unbind(dim=1)
    shift = first * scale
    for gain, offset in zip(gains, offsets, strict=True):
        scale = scale * gain
        shift = (shift + offset) * gain
    return image * scale.unsqueeze(1) - shift.unsqueeze(1)
