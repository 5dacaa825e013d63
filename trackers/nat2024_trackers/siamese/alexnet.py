"""AlexNet without padding, the feature network of SiamRPN++, SiamAPN, SiamAPN++, HiFT and LPAT.

Five stages of convolution, batch norm, max pooling (the first two), ReLU (all but the last) in
this order; stride 8. pysot and the trackers of vision4robotics name the layers differently.
"""

from collections.abc import Sequence
from typing import TypeAlias

import torch.nn.functional as F
from torch import Tensor, nn

from nat2024.networks.convolving import Convolution
from nat2024.networks.folding import Derived, may_derive

Layer: TypeAlias = tuple[nn.Conv2d, nn.BatchNorm2d]

_POOLED = 2
_CHANNELS = (3, 96, 256, 384, 384, 256)
_KERNELS = (11, 5, 3, 3, 3)


def alexnet_layers() -> list[Layer]:
    """The convolution and the batch norm of each stage, with fresh weights."""
    return [
        (nn.Conv2d(before, after, size, stride=1 if number else 2), nn.BatchNorm2d(after))
        for number, (before, after, size) in enumerate(
            zip(_CHANNELS, _CHANNELS[1:], _KERNELS, strict=False)
        )
    ]


class AlexNetStages(nn.Module):
    """What both namings share; a subclass registers the layers and tells them by `layers`."""

    def __init__(self) -> None:
        super().__init__()
        self._folded = Derived(self, self._fold)

    @property
    def layers(self) -> Sequence[Layer]:
        """The convolution and the batch norm of each stage."""
        raise NotImplementedError

    def stages(self, crops: Tensor) -> list[Tensor]:
        """Features of all five stages of crops (n, 3, S, S).

        Of S = 127 they are 29, 12, 10, 8, 6 wide, of S = 287 69, 32, 30, 28, 26; the first two
        are taken after pooling.
        """
        folded = self._folded() if may_derive(self) else None
        features, found = crops, []
        for number, (convolution, norm) in enumerate(self.layers):
            features = folded[number](features) if folded else norm(convolution(features))
            if number < _POOLED:
                features = F.max_pool2d(features, 3, stride=2)
            if number < len(_KERNELS) - 1:
                features = F.relu(features)
            found.append(features)
        return found

    def _fold(self) -> list[Convolution]:
        return [Convolution.of(convolution, norm) for convolution, norm in self.layers]


class AlexNet(AlexNetStages):
    """The naming of SiamAPN, SiamAPN++, HiFT and LPAT.

    Keys `layer1..5.0` are convolutions, `layer1..5.1` batch norms.
    """

    def __init__(self) -> None:
        """Build with fresh weights."""
        super().__init__()
        for number, layer in enumerate(alexnet_layers(), 1):
            self.add_module(f"layer{number}", nn.Sequential(*layer))

    @property
    def layers(self) -> Sequence[Layer]:
        """The convolution and the batch norm of each stage."""
        found = []
        for number in range(1, len(_KERNELS) + 1):
            convolution, norm = self.get_submodule(f"layer{number}").children()
            assert isinstance(convolution, nn.Conv2d)
            assert isinstance(norm, nn.BatchNorm2d)
            found.append((convolution, norm))
        return found

    def forward(self, crops: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Features of stages 3, 4 and 5; see `stages`."""
        _, _, third, fourth, fifth = self.stages(crops)
        return third, fourth, fifth
