"""MobileNetV2, 1.4 times as wide, with dilations instead of the last strides, as in pysot."""

from torch import Tensor, nn

from nat2024_trackers.siamese.layers import Layers

WIDTH = 1.4

# expansion, channels before widening, blocks, stride, dilation
_LAYERS = (
    (1, 16, 1, 1, 1),
    (6, 24, 2, 2, 1),
    (6, 32, 3, 2, 1),
    (6, 64, 4, 1, 2),
    (6, 96, 3, 1, 2),
    (6, 160, 3, 1, 4),
    (6, 320, 1, 1, 4),
)
_USED = (3, 5, 7)


def widened(channels: int) -> int:
    """Channels after widening, cut to an integer, not rounded to a multiple of 8."""
    return int(channels * WIDTH)


class InvertedResidual(nn.Module):
    """1x1 expansion, 3x3 depthwise, 1x1 projection; a shortcut where shapes allow it."""

    def __init__(
        self, channels_in: int, channels_out: int, stride: int, expansion: int, dilation: int
    ) -> None:
        """Build with fresh weights; stride 2 has no padding."""
        super().__init__()
        inner = channels_in * expansion
        padding = dilation if dilation > 1 else 2 - stride
        self.has_shortcut = stride == 1 and channels_in == channels_out
        self.conv = Layers(
            nn.Conv2d(channels_in, inner, 1, bias=False),
            nn.BatchNorm2d(inner),
            nn.ReLU6(inplace=True),
            nn.Conv2d(inner, inner, 3, stride, padding, dilation, groups=inner, bias=False),
            nn.BatchNorm2d(inner),
            nn.ReLU6(inplace=True),
            nn.Conv2d(inner, channels_out, 1, bias=False),
            nn.BatchNorm2d(channels_out),
        )

    def forward(self, x: Tensor) -> Tensor:
        """(n, channels_in, h, w) to (n, channels_out, h', w')."""
        out: Tensor = self.conv(x)
        return x + out if self.has_shortcut else out


class MobileNetV2(nn.Module):
    """Features after layers 3, 5 and 7: 44, 134 and 448 channels, 15x15 of 127, 31x31 of 255."""

    channels = tuple(widened(_LAYERS[index - 1][1]) for index in _USED)

    def __init__(self) -> None:
        """Build with fresh weights."""
        super().__init__()
        channels = widened(32)
        self.layer0 = Layers(
            nn.Conv2d(3, channels, 3, stride=2, bias=False),
            nn.BatchNorm2d(channels),
            nn.ReLU6(inplace=True),
        )
        previous = 1
        for index, (expansion, base, count, stride, dilation) in enumerate(_LAYERS, 1):
            blocks: list[nn.Module] = []
            for block in range(count):
                entering = block == 0 and dilation != previous
                blocks.append(
                    InvertedResidual(
                        channels,
                        widened(base),
                        stride if block == 0 else 1,
                        expansion,
                        max(1, dilation // 2) if entering else dilation,
                    )
                )
                channels = widened(base)
            self.add_module(f"layer{index}", nn.Sequential(*blocks))
            previous = dilation

    def forward(self, crops: Tensor) -> list[Tensor]:
        """The three feature maps of crops (n, 3, S, S)."""
        x = self.layer0(crops)
        used = []
        for index in range(1, len(_LAYERS) + 1):
            x = self.get_submodule(f"layer{index}")(x)
            if index in _USED:
                used.append(x)
        return used
