"""The network of SCT (Ye et al., RA-L 2022): curves and noise from a small copy of the image.

The image is brought to 112x112 whatever its sides are; a convolutional encoder and decoder with a
transformer over positions and one over channels between them estimates six maps, the curve x_r and
the noise x_n of each colour. They are enlarged to the image's size and applied eight times.

Images are float32 (N, 3, H, W) of any size; feature maps are NCHW. Names of modules are those of
the official state dict.
"""

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from nat2024.networks.bands import bands_of
from nat2024.networks.convolving import FastConv2d
from nat2024_enhancers.sct.attention import EncoderLayer, Statistics

_SIDE = 112
_BORDER = 8
_ITERATIONS = 8
_WIDTHS = (32, 64, 128, 256)
_GRID = 8  # side of the deepest features


class ConvBlock(nn.Module):
    """Two 3x3 convolutions, each with LeakyReLU."""

    def __init__(self, inputs: int, outputs: int) -> None:
        super().__init__()
        self.block = nn.Sequential(
            FastConv2d(inputs, outputs, 3, padding=1),
            nn.LeakyReLU(inplace=True),
            FastConv2d(outputs, outputs, 3, padding=1),
            nn.LeakyReLU(inplace=True),
        )

    def forward(self, x: Tensor) -> Tensor:
        """(N, inputs, H, W) to (N, outputs, H, W)."""
        return self.block(x)  # type: ignore[no-any-return]


class OutputProjection(nn.Module):
    """A 3x3 convolution after the transformer."""

    def __init__(self, dim: int) -> None:
        super().__init__()
        self.proj = nn.Sequential(FastConv2d(dim, dim, 3, padding=1))

    def forward(self, x: Tensor) -> Tensor:
        """(N, dim, H, W) to the same."""
        return self.proj(x)  # type: ignore[no-any-return]


class SCTNet(nn.Module):
    """SCT for images of any size.

    Args:
        statistics: by what BatchNorms normalise in evaluation mode: "running" averages, or each
            "image" by itself.
    """

    def __init__(self, *, statistics: Statistics = "running") -> None:
        super().__init__()
        inputs = 3
        for level, width in enumerate(_WIDTHS, start=1):
            self.add_module(f"ConvBlock{level}", ConvBlock(inputs, width))
            self.add_module(f"pool{level}", FastConv2d(width, width, 4, stride=2, padding=1))
            inputs = width
        self.encoderlayer_0 = EncoderLayer(_WIDTHS[-1], 0.0, statistics)
        self.encoderlayer_1 = EncoderLayer(_GRID**2, 0.1, statistics)
        self.output_proj = OutputProjection(_WIDTHS[-1])
        for level, width in zip(range(6, 10), _WIDTHS[::-1], strict=True):
            self.add_module(f"upv{level}", nn.ConvTranspose2d(inputs, width, 2, stride=2))
            self.add_module(f"ConvBlock{level}", ConvBlock(2 * width, width))
            inputs = width
        self.conv10 = nn.Sequential(FastConv2d(inputs, 6, 3, padding=1))

    def forward(self, image: Tensor) -> Tensor:
        """(N, 3, H, W) in 0..1 to the enhanced image, not limited to 0..1."""
        return enhance(image, *self._enlarge(self.estimate(image), image))

    def maps(self, image: Tensor) -> dict[str, Tensor]:
        """`conv10_full_128` (N, 6, 128, 128), and `x_r` and `x_n` (N, 3, H, W) cut from it."""
        estimated = self.estimate(image)
        curve, noise = self._enlarge(estimated, image)
        return {"conv10_full_128": estimated, "x_r": curve, "x_n": noise}

    def estimate(self, image: Tensor) -> Tensor:
        """(N, 3, H, W) to the six maps (N, 6, 128, 128), -1..1, with their border."""
        x = F.interpolate(image, (_SIDE, _SIDE), mode="bilinear", align_corners=False)
        x = F.pad(x, (_BORDER,) * 4, mode="reflect")
        # Channels-last is faster; the BatchNorms are inside the transformer and see none of it.
        x = x.contiguous(memory_format=torch.channels_last)
        skips = []
        for level in range(1, 5):
            skips.append(self._layer(f"ConvBlock{level}", x))
            x = self._layer(f"pool{level}", skips[-1])
        x = self.output_proj(self._transform(x))
        for level in range(6, 10):
            x = torch.cat([self._layer(f"upv{level}", x), skips.pop()], dim=1)
            x = self._layer(f"ConvBlock{level}", x)
        return torch.tanh(self.conv10(x).contiguous())

    def _transform(self, x: Tensor) -> Tensor:
        tokens = self.encoderlayer_0(x.flatten(2).transpose(1, 2))
        channels = self.encoderlayer_1(tokens.transpose(1, 2))
        grid = channels.unflatten(2, (_GRID, _GRID))
        return grid.contiguous(memory_format=torch.channels_last)  # type: ignore[no-any-return]

    def _enlarge(self, estimated: Tensor, image: Tensor) -> tuple[Tensor, Tensor]:
        inner = slice(_BORDER, _BORDER + _SIDE)
        maps = estimated[..., inner, inner].contiguous()
        maps = F.interpolate(maps, image.shape[-2:], mode="bilinear", align_corners=False)
        curve, noise = maps.chunk(2, dim=1)
        return curve, noise

    def _layer(self, name: str, x: Tensor) -> Tensor:
        return self.get_submodule(name)(x)  # type: ignore[no-any-return]


def enhance(image: Tensor, curve: Tensor, noise: Tensor) -> Tensor:
    """Add the noise map and bend by the curve, eight times; all (N, 3, H, W), no limits.

    Band by band: what eight passes over a band need stays near the processor.
    """
    count, _, height, width = image.shape
    parts = []
    for start, stop in bands_of(count, height, width):
        x, x_r, x_n = (whole[..., start:stop, :] for whole in (image, curve, noise))
        for _ in range(_ITERATIONS):
            x = x + x_n
            x = torch.addcmul(x, x_r, x * x - x)
        parts.append(x)
    return parts[0] if len(parts) == 1 else torch.cat(parts, dim=-2)
