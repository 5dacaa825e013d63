"""The small network of the variant `compact`, which trains from fresh weights on a CPU.

Seven 3x3 convolutions without padding, whose maps have the sizes of AlexNet's (6 of 127, 22 of
255), under the head of SiamRPN++ 128 channels wide. Nothing is padded, so it may be trained on
smaller search crops than it tracks with.
"""

import torch
from torch import Tensor, nn

from nat2024_trackers.siamese.layers import Layers
from nat2024_trackers.siamrpnpp.model import DepthwiseRPN

WIDTH = 128
"""Channels of the deeper layers and of the head."""

_DEEP = 4
_CONTRAST_FLOOR = 3.0
"""Grey levels added to the spread of a template, so that a flat one is not blown up to noise."""


def _convolution(channels_in: int, channels_out: int, stride: int) -> list[nn.Module]:
    return [
        nn.Conv2d(channels_in, channels_out, 3, stride, bias=False),
        nn.BatchNorm2d(channels_out),
    ]


class SmallBackbone(Layers):
    """Stride 8; the first convolution has a quarter of the width, the second half of it."""

    def __init__(self, width: int = WIDTH) -> None:
        """Build with fresh weights."""
        layers: list[nn.Module] = []
        before = 3
        for channels in (width // 4, width // 2):
            layers += [*_convolution(before, channels, 2), nn.ReLU(inplace=True)]
            before = channels
        layers += [*_convolution(before, width, 1), nn.ReLU(inplace=True), nn.MaxPool2d(2)]
        for number in range(_DEEP):
            layers += _convolution(width, width, 1)
            if number < _DEEP - 1:
                layers.append(nn.ReLU(inplace=True))
        super().__init__(*layers)


class CompactSiamRPN(nn.Module):
    """The whole network; crops are float32 (n, 3, side, side), 0..255, BGR.

    Mean and spread of the template, over all pixels and channels, normalise the template and
    every search crop of its sequence: the same object then enters with the same values whatever
    surrounds it later. Both numbers travel with the template's kernels.
    """

    def __init__(self, width: int = WIDTH) -> None:
        """Build with fresh weights; `width` counts the channels of backbone and head."""
        super().__init__()
        self.backbone = SmallBackbone(width)
        self.rpn_head = DepthwiseRPN(width)
        for module in self.modules():
            if isinstance(module, nn.Conv2d):
                nn.init.kaiming_normal_(module.weight, nonlinearity="relu")
        for branch in (self.rpn_head.cls, self.rpn_head.loc):
            last = branch.head[-1]
            assert isinstance(last, nn.Conv2d)
            assert last.bias is not None
            nn.init.normal_(last.weight, std=0.01)
            nn.init.zeros_(last.bias)

    def embed(self, template: Tensor) -> tuple[Tensor, ...]:
        """Of template crops (n, 3, 127, 127): kernels of cls and loc, mean and spread (n, 1, 1, 1).

        All constant through a sequence.
        """
        mean, spread = template_statistics(template)
        kernels = self.rpn_head.embed([self.describe(template, mean, spread)])
        return (*kernels, mean, spread)

    def describe(self, crops: Tensor, mean: Tensor, spread: Tensor) -> Tensor:
        """Features (n, width, s, s) of crops normalised by their template's statistics."""
        features: Tensor = self.backbone((crops - mean) / spread)
        return features

    def match(self, kernels: tuple[Tensor, ...], search: Tensor) -> tuple[Tensor, Tensor]:
        """(cls, loc): (n, 10, map, map) and (n, 20, map, map) of search crops."""
        classes, offsets, mean, spread = kernels
        return self.rpn_head((classes, offsets), [self.describe(search, mean, spread)])  # type: ignore[no-any-return]

    def forward(self, template: Tensor, search: Tensor) -> tuple[Tensor, Tensor]:
        """Both sides at once."""
        return self.match(self.embed(template), search)


def template_statistics(template: Tensor) -> tuple[Tensor, Tensor]:
    """Mean and spread, (n, 1, 1, 1) each, that normalise the crops of a template's sequence."""
    mean = template.mean(dim=(1, 2, 3), keepdim=True)
    variance = torch.var(template, dim=(1, 2, 3), keepdim=True, correction=0)
    return mean, variance.sqrt() + _CONTRAST_FLOOR
