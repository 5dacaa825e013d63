"""The network of LLVE (Zhang et al., CVPR 2021; code StableLLVE): a U-Net for single frames.

Images are float32 (N, 3, H, W), BGR in the authors' training and test, sides of at least 16.
Names of modules are those of the official state dict.
"""

from collections.abc import Iterator

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from nat2024.networks.bands import bands_of, run_in_bands
from nat2024.networks.convolving import FastConv2d

SMALLEST = 16
"""Sides below this would vanish in four halvings."""

_HALO = 2  # two 3x3 convolutions


class DoubleConv(nn.Module):
    """Two 3x3 convolutions, each with ReLU."""

    def __init__(self, inputs: int, middle: int, outputs: int) -> None:
        super().__init__()
        self.double_conv = nn.Sequential(
            FastConv2d(inputs, middle, 3, padding=1),
            nn.ReLU(inplace=True),
            FastConv2d(middle, outputs, 3, padding=1),
            nn.ReLU(inplace=True),
        )

    def forward(self, x: Tensor) -> Tensor:
        """(N, inputs, H, W) to (N, outputs, H, W)."""
        return self.double_conv(x)  # type: ignore[no-any-return]


class Down(nn.Module):
    """Halves both sides, rounded down."""

    def __init__(self, inputs: int, outputs: int) -> None:
        super().__init__()
        self.maxpool_conv = nn.Sequential(nn.MaxPool2d(2), DoubleConv(inputs, outputs, outputs))

    def forward(self, x: Tensor) -> Tensor:
        """(N, inputs, H, W) to (N, outputs, H // 2, W // 2)."""
        return self.maxpool_conv(x)  # type: ignore[no-any-return]


class Up(nn.Module):
    """Doubles both sides and joins what was skipped."""

    def __init__(self, inputs: int, outputs: int) -> None:
        super().__init__()
        self.conv = DoubleConv(inputs, inputs // 2, outputs)

    def forward(self, deep: Tensor, skip: Tensor) -> Tensor:
        """(N, inputs / 2, H // 2, W // 2) and (N, inputs / 2, H, W) to (N, outputs, H, W)."""
        return _join([self.rows(deep, skip, *band) for band in _bands(skip)])

    def rows(self, deep: Tensor, skip: Tensor, start: int, stop: int) -> Tensor:
        """Rows `start` to `stop` of what `forward` gives, computed from these rows and a halo."""
        above, below = max(start - _HALO, 0), min(stop + _HALO, skip.shape[-2])
        raised = doubled_rows(deep, above, below)
        rows = below - above - raised.shape[-2]
        columns = skip.shape[-1] - raised.shape[-1]
        if rows or columns:  # a side that was rounded down lacks its last row or column
            raised = F.pad(raised, (0, columns, 0, rows))
        x = self.conv(torch.cat([skip[..., above:below, :], raised], dim=1))
        return x[..., start - above : stop - above, :]  # type: ignore[no-any-return]


def doubled_rows(x: Tensor, start: int, stop: int) -> Tensor:
    """Rows `start` to `stop`, where there are as many, of `x` enlarged twice between its corners.

    The same as those rows of bilinear interpolation with `align_corners=True`, whose weights
    depend on the whole height, so that a band of `x` cannot simply be enlarged.
    """
    height, width = x.shape[-2:]
    stop = min(stop, 2 * height)
    if (start, stop) == (0, 2 * height):
        return F.interpolate(x, scale_factor=2, mode="bilinear", align_corners=True)
    places = torch.arange(start, stop, device=x.device) * ((height - 1) / (2 * height - 1))
    upper = places.floor().long().clamp_max(height - 1)
    lower = (upper + 1).clamp_max(height - 1)
    share = (places - upper).to(x.dtype)[:, None]
    rows = torch.lerp(x[..., upper, :], x[..., lower, :], share)
    return F.interpolate(rows, (stop - start, 2 * width), mode="bilinear", align_corners=True)


class OutConv(nn.Module):
    """Features to an image."""

    def __init__(self, inputs: int) -> None:
        super().__init__()
        self.conv = FastConv2d(inputs, 3, 1)

    def forward(self, x: Tensor) -> Tensor:
        """(N, inputs, H, W) to (N, 3, H, W)."""
        return self.conv(x)  # type: ignore[no-any-return]


class LLVENet(nn.Module):
    """LLVE for images whose sides are at least 16."""

    def __init__(self) -> None:
        super().__init__()
        self.inc = DoubleConv(3, 32, 32)
        self.down1 = Down(32, 64)
        self.down2 = Down(64, 128)
        self.down3 = Down(128, 256)
        self.down4 = Down(256, 256)
        self.up1 = Up(512, 128)
        self.up2 = Up(256, 64)
        self.up3 = Up(128, 32)
        self.up4 = Up(64, 32)
        self.outc = OutConv(32)
        self.apply(_initialise)

    def forward(self, image: Tensor) -> Tensor:
        """(N, 3, H, W) in 0..1 to the enhanced image, not limited to 0..1."""
        # Channels-last is faster on CPU and GPU alike; there is no BatchNorm that it would harm.
        image = image.contiguous(memory_format=torch.channels_last)
        x1 = run_in_bands(self.inc, image, halo=_HALO)
        x2 = self.down1(x1)
        x3 = self.down2(x2)
        x4 = self.down3(x3)
        x = self.up1(self.down4(x4), x4)
        x = self.up3(self.up2(x, x3), x2)
        return _join([self.outc(self.up4.rows(x, x1, *band)) for band in _bands(x1)]).contiguous()


def _bands(x: Tensor) -> Iterator[tuple[int, int]]:
    """Bands of rows for the large levels, which is where the memory goes."""
    count, _, height, width = x.shape
    return bands_of(count, height, width)


def _join(parts: list[Tensor]) -> Tensor:
    """Bands of rows, one below the other; a single one is not copied."""
    return parts[0] if len(parts) == 1 else torch.cat(parts, dim=-2)


def _initialise(module: nn.Module) -> None:
    if isinstance(module, nn.Conv2d):
        nn.init.kaiming_normal_(module.weight)
        assert module.bias is not None
        nn.init.zeros_(module.bias)
