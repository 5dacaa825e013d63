"""DarkLighter (Ye et al., IROS 2021) with its layers written plainly, as a yardstick for speed.

What the official code computes: the features put together before each wide layer, a convolution
for each of the two maps, one step after the other over the whole image.
"""

import torch
from torch import Tensor, nn


class Peer(nn.Module):
    """The network, which takes any size."""

    def __init__(self) -> None:
        super().__init__()
        self.relu = nn.ReLU(inplace=True)
        self.e_conv1 = nn.Conv2d(3, 32, 3, padding=1)
        self.e_conv2 = nn.Conv2d(32, 32, 3, padding=1)
        self.e_conv3 = nn.Conv2d(64, 32, 3, padding=1)
        self.e_conv4 = nn.Conv2d(64, 32, 3, padding=1)
        self.e_conv5 = nn.Conv2d(64, 32, 3, padding=1)
        self.e_conv7 = nn.Conv2d(64, 8, 3, padding=1)
        self.e_conv8 = nn.Conv2d(64, 8, 3, padding=1)

    def forward(self, batch: Tensor) -> Tensor:
        """Enhance (N, 3, H, W); no clamp."""
        x1 = self.relu(self.e_conv1(batch))
        x2 = self.relu(self.e_conv2(x1))
        x3 = self.relu(self.e_conv3(torch.cat([x1, x2], dim=1)))
        x4 = self.relu(self.e_conv4(torch.cat([x2, x3], dim=1)))
        x5 = self.relu(self.e_conv5(torch.cat([x3, x4], dim=1)))
        last = torch.cat([x4, x5], dim=1)
        light = torch.tanh(self.e_conv7(last)) + 1
        noise = torch.tanh(self.e_conv8(last))
        x = batch
        for gain, offset in zip(light.split(1, dim=1), noise.split(1, dim=1), strict=True):
            x = (x - offset) * gain
        return x


def build() -> nn.Module:
    """The network in eval mode, with the official checkpoint's keys."""
    return Peer().eval()
