"""AlexNet without padding, the `alexnetlegacy` backbone of pysot."""

import torch
from torch import Tensor, nn


class AlexNet(nn.Module):
    """Five stages of convolution, batch norm, pooling and ReLU in this order; stride 8.

    Keys `features.{0,4,8,11,14}` are convolutions, `features.{1,5,9,12,15}` batch norms. The last
    stage has no ReLU.
    """

    channels = (256,)

    def __init__(self) -> None:
        """Build with fresh weights."""
        super().__init__()
        self.features = nn.Sequential(
            nn.Conv2d(3, 96, 11, stride=2),
            nn.BatchNorm2d(96),
            nn.MaxPool2d(3, stride=2),
            nn.ReLU(inplace=True),
            nn.Conv2d(96, 256, 5),
            nn.BatchNorm2d(256),
            nn.MaxPool2d(3, stride=2),
            nn.ReLU(inplace=True),
            nn.Conv2d(256, 384, 3),
            nn.BatchNorm2d(384),
            nn.ReLU(inplace=True),
            nn.Conv2d(384, 384, 3),
            nn.BatchNorm2d(384),
            nn.ReLU(inplace=True),
            nn.Conv2d(384, 256, 3),
            nn.BatchNorm2d(256),
        )

    def forward(self, crops: Tensor) -> list[Tensor]:
        """Features (n, 256, s, s) of crops (n, 3, S, S): 6 of 127, 26 of 287."""
        features: torch.Tensor = self.features(crops)
        return [features]
