"""AlexNet under the names of pysot, its `alexnetlegacy` backbone."""

from collections.abc import Sequence

from torch import Tensor, nn

from nat2024_trackers.siamese.alexnet import AlexNetStages, Layer, alexnet_layers

_CONVOLUTIONS = (0, 4, 8, 11, 14)


class AlexNet(AlexNetStages):
    """Keys `features.{0,4,8,11,14}` are convolutions, `features.{1,5,9,12,15}` batch norms."""

    channels = (256,)

    def __init__(self) -> None:
        """Build with fresh weights."""
        super().__init__()
        self.features = nn.ModuleDict()
        for number, (convolution, norm) in zip(_CONVOLUTIONS, alexnet_layers(), strict=True):
            self.features[str(number)] = convolution
            self.features[str(number + 1)] = norm

    @property
    def layers(self) -> Sequence[Layer]:
        """The convolution and the batch norm of each stage."""
        found = []
        for number in _CONVOLUTIONS:
            convolution, norm = self.features[str(number)], self.features[str(number + 1)]
            assert isinstance(convolution, nn.Conv2d)
            assert isinstance(norm, nn.BatchNorm2d)
            found.append((convolution, norm))
        return found

    def forward(self, crops: Tensor) -> list[Tensor]:
        """Features (n, 256, s, s) of crops (n, 3, S, S): 6 of 127, 26 of 287."""
        return [self.stages(crops)[-1]]
