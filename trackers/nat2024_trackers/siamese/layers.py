"""Convolutions with their norms, as the heads of Siamese networks have them."""

import torch.nn.functional as F
from torch import Tensor, nn

from nat2024.networks.convolving import Convolution
from nat2024.networks.folding import Derived, may_derive

_GROUPS = 32


class Layers(nn.Sequential):
    """A sequence that begins with a convolution; faster than `nn.Sequential` at inference.

    There every batch norm is part of the convolution before it, and ReLUs work in place. Keys are
    those of `nn.Sequential`.
    """

    def __init__(self, *layers: nn.Module) -> None:
        """Take the layers in their order; a batch norm must follow a convolution."""
        super().__init__(*layers)
        self._folded = Derived(self, self._fold)

    def forward(self, maps: Tensor) -> Tensor:
        """All layers after each other."""
        if not may_derive(self):
            for layer in self:
                maps = layer(maps)
            return maps
        folded = self._folded()
        for number, layer in enumerate(self):
            if isinstance(layer, nn.Conv2d):
                maps = folded[number](maps)
            elif isinstance(layer, nn.ReLU):
                maps = F.relu_(maps)
            elif not isinstance(layer, nn.BatchNorm2d):
                maps = layer(maps)
        return maps

    def _fold(self) -> dict[int, Convolution]:
        """Each convolution, by its place, with the norm after it."""
        layers = [*self, None]
        found = {}
        for number, layer in enumerate(self):
            if isinstance(layer, nn.Conv2d):
                follower = layers[number + 1]
                norm = follower if isinstance(follower, nn.BatchNorm2d) else None
                found[number] = Convolution.of(layer, norm)
        return found


def conv_batch_norm(
    channels_in: int, channels_out: int, *, size: int = 3, padding: int = 0, bias: bool = True
) -> list[nn.Module]:
    """A convolution with batch norm and ReLU."""
    return [
        nn.Conv2d(channels_in, channels_out, size, padding=padding, bias=bias),
        nn.BatchNorm2d(channels_out),
        nn.ReLU(inplace=True),
    ]


def conv_group_norm(channels_in: int, channels_out: int) -> list[nn.Module]:
    """A padded 3x3 convolution with group norm of 32 groups and ReLU."""
    return [
        nn.Conv2d(channels_in, channels_out, 3, padding=1),
        nn.GroupNorm(_GROUPS, channels_out),
        nn.ReLU(inplace=True),
    ]


def tower(channels: int, count: int, channels_out: int | None = None) -> Layers:
    """`count` convolutions with group norm, and one more to `channels_out` where that is given."""
    layers = [layer for _ in range(count) for layer in conv_group_norm(channels, channels)]
    if channels_out is not None:
        layers.append(nn.Conv2d(channels, channels_out, 3, padding=1))
    return Layers(*layers)
