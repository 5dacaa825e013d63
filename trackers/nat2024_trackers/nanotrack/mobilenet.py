"""MobileNetV3-small up to stride 16, the feature network of NanoTrack."""

from torch import Tensor, nn

_FIRST = 16
# kernel, inner channels, outer channels, squeeze and excite, hard swish, stride
_BLOCKS = (
    (3, 16, 16, True, False, 2),
    (3, 72, 24, False, False, 2),
    (3, 88, 24, False, False, 1),
    (5, 96, 40, True, True, 2),
    (5, 240, 40, True, True, 1),
    (5, 240, 40, True, True, 1),
    (5, 120, 48, True, True, 1),
    (5, 144, 48, True, True, 1),
    (5, 288, 96, True, True, 1),
)
BLOCKS = {"v1": 8, "v2": 8, "v3": 9}
"""How many of the blocks each version has."""


def channels_of(variant: str) -> int:
    """Channels of the features of a version."""
    return _BLOCKS[BLOCKS[variant] - 1][2]


def divisible(channels: float, divisor: int = 8) -> int:
    """The nearest multiple of `divisor` that is not more than a tenth below `channels`."""
    nearest = max(divisor, int(channels + divisor / 2) // divisor * divisor)
    return nearest + divisor if nearest < 0.9 * channels else nearest


class SqueezeExcite(nn.Module):
    """A factor 0..1 for each channel, from the means of all."""

    def __init__(self, channels: int) -> None:
        """Build with fresh weights."""
        super().__init__()
        inner = divisible(channels / 4)
        self.fc = nn.Sequential(
            nn.Linear(channels, inner),
            nn.ReLU(inplace=True),
            nn.Linear(inner, channels),
            nn.Hardsigmoid(),
        )

    def forward(self, x: Tensor) -> Tensor:
        """(n, channels, h, w) to the same shape."""
        factors: Tensor = self.fc(x.mean((2, 3)))
        return x * factors[:, :, None, None]


def _activation(*, hard_swish: bool) -> nn.Module:
    return nn.Hardswish(inplace=True) if hard_swish else nn.ReLU(inplace=True)


class InvertedResidual(nn.Module):
    """1x1 expansion, depthwise convolution, 1x1 projection; a shortcut where shapes allow it.

    Where nothing is expanded (the first block) there is no first 1x1, and squeeze and excite comes
    after the activation; elsewhere it comes before it.
    """

    def __init__(
        self,
        channels_in: int,
        kernel: int,
        inner: int,
        channels_out: int,
        squeezes: bool,
        hard_swish: bool,
        stride: int,
    ) -> None:
        """Build with fresh weights."""
        super().__init__()
        self.has_shortcut = stride == 1 and channels_in == channels_out
        padding = kernel // 2
        depthwise = [
            nn.Conv2d(inner, inner, kernel, stride, padding, groups=inner, bias=False),
            nn.BatchNorm2d(inner),
        ]
        excite = SqueezeExcite(inner) if squeezes else nn.Identity()
        activation = _activation(hard_swish=hard_swish)
        layers: list[nn.Module]
        if inner == channels_in:
            layers = [*depthwise, activation, excite]
        else:
            layers = [
                nn.Conv2d(channels_in, inner, 1, bias=False),
                nn.BatchNorm2d(inner),
                _activation(hard_swish=hard_swish),
                *depthwise,
                excite,
                activation,
            ]
        projection = [nn.Conv2d(inner, channels_out, 1, bias=False), nn.BatchNorm2d(channels_out)]
        self.conv = nn.Sequential(*layers, *projection)

    def forward(self, x: Tensor) -> Tensor:
        """(n, channels_in, h, w) to (n, channels_out, h', w')."""
        out: Tensor = self.conv(x)
        return x + out if self.has_shortcut else out


class MobileNetV3(nn.Module):
    """Features of crops: 8x8 of 127, 16x16 of 255; keys `features.*`."""

    def __init__(self, blocks: int) -> None:
        """Build with fresh weights."""
        super().__init__()
        layers: list[nn.Module] = [
            nn.Sequential(
                nn.Conv2d(3, _FIRST, 3, 2, 1, bias=False),
                nn.BatchNorm2d(_FIRST),
                nn.Hardswish(inplace=True),
            )
        ]
        channels = _FIRST
        for kernel, inner, outer, squeezes, hard_swish, stride in _BLOCKS[:blocks]:
            layers.append(
                InvertedResidual(channels, kernel, inner, outer, squeezes, hard_swish, stride)
            )
            channels = outer
        self.features = nn.Sequential(*layers)

    def forward(self, crops: Tensor) -> Tensor:
        """(n, 3, S, S) to (n, channels, s, s)."""
        features: Tensor = self.features(crops)
        return features
