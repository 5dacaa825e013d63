"""Layers of HiFT and LPAT for maps of 11 cells.

Such maps are so small that, unlike those of the backbone, they are convolved faster in PyTorch's
default memory layout.
"""

import torch.nn.functional as F
from torch import Tensor, nn

from nat2024.networks.folding import Derived, fold_batch_norm, may_derive
from nat2024_trackers.siamese.layers import conv_group_norm


class MergedConv(nn.Module):
    """Convolution without bias, batch norm, ReLU; one convolution at inference."""

    def __init__(
        self, convolution: nn.Conv2d, norm: nn.BatchNorm2d, names: tuple[str, str]
    ) -> None:
        """Register both layers under `names`."""
        super().__init__()
        self._names = names
        for name, layer in zip(names, (convolution, norm), strict=True):
            self.add_module(name, layer)
        self._folded = Derived(self, self._fold)

    @property
    def parts(self) -> tuple[nn.Conv2d, nn.BatchNorm2d]:
        """Both layers."""
        convolution, norm = (self.get_submodule(name) for name in self._names)
        assert isinstance(convolution, nn.Conv2d)
        assert isinstance(norm, nn.BatchNorm2d)
        return convolution, norm

    def forward(self, maps: Tensor) -> Tensor:
        """(n, channels in, h, w) to (n, channels out, ...)."""
        convolution, norm = self.parts
        if not may_derive(self):
            return F.relu(norm(convolution(maps)))
        weight, bias = self._folded()
        return F.conv2d(maps, weight, bias, convolution.stride, convolution.padding).relu_()

    def _fold(self) -> tuple[Tensor, Tensor]:
        return fold_batch_norm(*self.parts)


def halving_conv(channels_in: int, channels_out: int) -> MergedConv:
    """3x3 convolution with stride 2, batch norm, ReLU."""
    convolution = nn.Conv2d(channels_in, channels_out, 3, stride=2, padding=1, bias=False)
    return MergedConv(convolution, nn.BatchNorm2d(channels_out), ("0", "1"))


def head(channels: int, channels_out: int | None = None) -> nn.Sequential:
    """Three convolutions with group norm, and one to `channels_out` where that is given."""
    layers = [layer for _ in range(3) for layer in conv_group_norm(channels, channels)]
    if channels_out is not None:
        layers.append(nn.Conv2d(channels, channels_out, 3, padding=1))
    return nn.Sequential(*layers)
