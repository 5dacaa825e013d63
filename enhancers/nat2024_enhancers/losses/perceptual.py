"""SCT's loss (Ye et al., RA-L 2022): a tracker's features stay those of a bright image."""

from typing import NamedTuple

import torch.nn.functional as F
from torch import Tensor, nn


class PerceptualTerms(NamedTuple):
    """Mean squared distances of the features of three layers; the loss is their sum."""

    layer3: Tensor
    layer4: Tensor
    layer5: Tensor


class TrackingAlexNet(nn.Module):
    """The AlexNet of Siamese trackers, names as in pysot's `alexnet-bn.pth`."""

    def __init__(self) -> None:
        super().__init__()
        self.layer1 = nn.Sequential(
            nn.Conv2d(3, 96, 11, 2), nn.BatchNorm2d(96), nn.MaxPool2d(3, 2), nn.ReLU()
        )
        self.layer2 = nn.Sequential(
            nn.Conv2d(96, 256, 5), nn.BatchNorm2d(256), nn.MaxPool2d(3, 2), nn.ReLU()
        )
        self.layer3 = nn.Sequential(nn.Conv2d(256, 384, 3), nn.BatchNorm2d(384), nn.ReLU())
        self.layer4 = nn.Sequential(nn.Conv2d(384, 384, 3), nn.BatchNorm2d(384), nn.ReLU())
        self.layer5 = nn.Sequential(nn.Conv2d(384, 256, 3), nn.BatchNorm2d(256))

    def forward(self, image: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """(N, 3, H, W) to the features of the last three layers."""
        third = self.layer3(self.layer2(self.layer1(image)))
        fourth = self.layer4(third)
        return third, fourth, self.layer5(fourth)


def perceptual_terms(network: TrackingAlexNet, enhanced: Tensor, target: Tensor) -> PerceptualTerms:
    """Compare the features of enhanced images and of targets.

    The official code keeps the network in training mode, so that its BatchNorm takes each batch's
    own statistics, and feeds 0..1 where trackers feed 0..255; give `network` in that mode for the
    official numbers.
    """
    pairs = zip(network(enhanced), network(target), strict=True)
    return PerceptualTerms(*(F.mse_loss(mine, other) for mine, other in pairs))
