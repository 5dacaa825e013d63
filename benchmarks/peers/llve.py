"""LLVE (StableLLVE) written plainly, layer by layer, as a yardstick for speed and memory.

`build()` gives the network with the names of the official state dict; it sees BGR.
"""

import torch
import torch.nn.functional as F
from torch import Tensor, nn


class DoubleConv(nn.Module):
    """Two convolutions, each with ReLU."""

    def __init__(self, inputs: int, outputs: int, middle: int | None = None) -> None:
        super().__init__()
        middle = middle or outputs
        self.double_conv = nn.Sequential(
            nn.Conv2d(inputs, middle, 3, padding=1),
            nn.ReLU(inplace=True),
            nn.Conv2d(middle, outputs, 3, padding=1),
            nn.ReLU(inplace=True),
        )

    def forward(self, x: Tensor) -> Tensor:
        """Keeps height and width."""
        return self.double_conv(x)


class Down(nn.Module):
    """Halves both sides, rounded down."""

    def __init__(self, inputs: int, outputs: int) -> None:
        super().__init__()
        self.maxpool_conv = nn.Sequential(nn.MaxPool2d(2), DoubleConv(inputs, outputs))

    def forward(self, x: Tensor) -> Tensor:
        """(N, inputs, H, W) to half the size."""
        return self.maxpool_conv(x)


class Up(nn.Module):
    """Doubles both sides and joins what was skipped."""

    def __init__(self, inputs: int, outputs: int) -> None:
        super().__init__()
        self.up = nn.Upsample(scale_factor=2, mode="bilinear", align_corners=True)
        self.conv = DoubleConv(inputs, outputs, inputs // 2)

    def forward(self, x: Tensor, skip: Tensor) -> Tensor:
        """Features and what was skipped to features of the latter's size."""
        x = self.up(x)
        rows, columns = skip.shape[2] - x.shape[2], skip.shape[3] - x.shape[3]
        left, top = columns // 2, rows // 2
        x = F.pad(x, [left, columns - left, top, rows - top])
        return self.conv(torch.cat([skip, x], dim=1))


class OutConv(nn.Module):
    """Features to an image."""

    def __init__(self) -> None:
        super().__init__()
        self.conv = nn.Conv2d(32, 3, 1)

    def forward(self, x: Tensor) -> Tensor:
        """(N, 32, H, W) to (N, 3, H, W)."""
        return self.conv(x)


class Network(nn.Module):
    """The U-Net."""

    def __init__(self) -> None:
        super().__init__()
        self.inc = DoubleConv(3, 32)
        self.down1 = Down(32, 64)
        self.down2 = Down(64, 128)
        self.down3 = Down(128, 256)
        self.down4 = Down(256, 256)
        self.up1 = Up(512, 128)
        self.up2 = Up(256, 64)
        self.up3 = Up(128, 32)
        self.up4 = Up(64, 32)
        self.outc = OutConv()

    def forward(self, batch: Tensor) -> Tensor:
        """(N, 3, H, W) in 0..1 with sides of at least 16 to the enhanced image."""
        x1 = self.inc(batch)
        x2 = self.down1(x1)
        x3 = self.down2(x2)
        x4 = self.down3(x3)
        x5 = self.down4(x4)
        x = self.up1(x5, x4)
        x = self.up2(x, x3)
        x = self.up3(x, x2)
        x = self.up4(x, x1)
        return self.outc(x)


def build() -> nn.Module:
    """The network in evaluation mode."""
    return Network().eval()
