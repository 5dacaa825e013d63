"""DCE++ (Li et al., TPAMI 2021) with its layers written plainly, as a yardstick for speed.

What the official code computes at test time: scale factor 12, the features put together before
each wide layer, one step of the curve after the other over the whole padded image.
"""

import torch
import torch.nn.functional as F
from torch import Tensor, nn

SCALE = 12


class Separable(nn.Module):
    """A 3x3 convolution of each channel, then a 1x1 convolution of all."""

    def __init__(self, inputs: int, outputs: int) -> None:
        super().__init__()
        self.depth_conv = nn.Conv2d(inputs, inputs, 3, padding=1, groups=inputs)
        self.point_conv = nn.Conv2d(inputs, outputs, 1)

    def forward(self, x: Tensor) -> Tensor:
        """(N, inputs, H, W) to (N, outputs, H, W)."""
        return self.point_conv(self.depth_conv(x))


class Peer(nn.Module):
    """The network and the padding that the authors' trackers do around it."""

    def __init__(self, scale: int = SCALE) -> None:
        super().__init__()
        self.scale = scale
        self.relu = nn.ReLU(inplace=True)
        self.e_conv1 = Separable(3, 32)
        self.e_conv2 = Separable(32, 32)
        self.e_conv3 = Separable(32, 32)
        self.e_conv4 = Separable(32, 32)
        self.e_conv5 = Separable(64, 32)
        self.e_conv6 = Separable(64, 32)
        self.e_conv7 = Separable(64, 3)

    def forward(self, batch: Tensor) -> Tensor:
        """Enhance (N, 3, H, W); no clamp."""
        height, width = batch.shape[-2:]
        padding = (0, -width % self.scale, 0, -height % self.scale)
        padded = F.pad(batch, padding, mode="reflect") if any(padding) else batch
        return self.enhance(padded, self.estimate(padded))[..., :height, :width]

    def estimate(self, x: Tensor) -> Tensor:
        """The curve parameters of every pixel."""
        if self.scale > 1:
            size = (x.shape[-2] // self.scale, x.shape[-1] // self.scale)
            x = F.interpolate(x, size=size, mode="bilinear")
        x1 = self.relu(self.e_conv1(x))
        x2 = self.relu(self.e_conv2(x1))
        x3 = self.relu(self.e_conv3(x2))
        x4 = self.relu(self.e_conv4(x3))
        x5 = self.relu(self.e_conv5(torch.cat([x3, x4], dim=1)))
        x6 = self.relu(self.e_conv6(torch.cat([x2, x5], dim=1)))
        curve = torch.tanh(self.e_conv7(torch.cat([x1, x6], dim=1)))
        if self.scale == 1:
            return curve
        return F.interpolate(curve, scale_factor=self.scale, mode="bilinear", align_corners=True)

    def enhance(self, x: Tensor, curve: Tensor) -> Tensor:
        """Eight steps, all with the same parameters."""
        for _ in range(8):
            x = x + curve * (torch.pow(x, 2) - x)
        return x


def build(scale: int = SCALE) -> nn.Module:
    """The network in eval mode, with the official checkpoint's keys."""
    return Peer(scale).eval()
