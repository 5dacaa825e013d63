"""ResNet-50 with dilations instead of the last two strides, as pysot uses it (stride 8)."""

import torch.nn.functional as F
from torch import Tensor, nn

from nat2024.networks.convolving import Convolution
from nat2024.networks.folding import Derived, may_derive
from nat2024_trackers.siamese.layers import Layers


class Bottleneck(nn.Module):
    """1x1, 3x3, 1x1 convolutions (the last to 4 times the channels) beside a shortcut."""

    expansion = 4

    def __init__(
        self,
        channels_in: int,
        channels: int,
        stride: int = 1,
        dilation: int = 1,
        downsample: nn.Module | None = None,
    ) -> None:
        """Build with fresh weights; a block of stride 2 has no padding in its 3x3."""
        super().__init__()
        padding = dilation if dilation > 1 else 2 - stride
        wide = channels * self.expansion
        self.conv1 = nn.Conv2d(channels_in, channels, 1, bias=False)
        self.bn1 = nn.BatchNorm2d(channels)
        self.conv2 = nn.Conv2d(channels, channels, 3, stride, padding, dilation, bias=False)
        self.bn2 = nn.BatchNorm2d(channels)
        self.conv3 = nn.Conv2d(channels, wide, 1, bias=False)
        self.bn3 = nn.BatchNorm2d(wide)
        self.relu = nn.ReLU(inplace=True)
        self.downsample = downsample
        self._folded = Derived(self, self._fold)

    def forward(self, x: Tensor) -> Tensor:
        """(n, c, h, w) to (n, 4 * channels, h', w')."""
        shortcut = x if self.downsample is None else self.downsample(x)
        if may_derive(self):
            first, second, third = self._folded()
            return F.relu_(third(F.relu_(second(F.relu_(first(x))))).add_(shortcut))
        out = self.relu(self.bn1(self.conv1(x)))
        out = self.relu(self.bn2(self.conv2(out)))
        out = self.bn3(self.conv3(out))
        result: Tensor = self.relu(out + shortcut)
        return result

    def _fold(self) -> list[Convolution]:
        pairs = ((self.conv1, self.bn1), (self.conv2, self.bn2), (self.conv3, self.bn3))
        return [Convolution.of(convolution, norm) for convolution, norm in pairs]


class ResNet50(nn.Module):
    """Features after layers 2, 3 and 4: 512, 1024 and 2048 channels, 15x15 of 127, 31x31 of 255."""

    channels = (512, 1024, 2048)

    def __init__(self) -> None:
        """Build with fresh weights."""
        super().__init__()
        self.conv1 = nn.Conv2d(3, 64, 7, stride=2, bias=False)
        self.bn1 = nn.BatchNorm2d(64)
        self.relu = nn.ReLU(inplace=True)
        self.maxpool = nn.MaxPool2d(3, stride=2, padding=1)
        self.layer1 = _layer(64, 64, 3)
        self.layer2 = _layer(256, 128, 4, stride=2)
        self.layer3 = _layer(512, 256, 6, dilation=2)
        self.layer4 = _layer(1024, 512, 3, dilation=4)

    def forward(self, crops: Tensor) -> list[Tensor]:
        """The three feature maps of crops (n, 3, S, S)."""
        x = self.layer1(self.maxpool(self.relu(self.bn1(self.conv1(crops)))))
        second = self.layer2(x)
        third = self.layer3(second)
        return [second, third, self.layer4(third)]


def _layer(
    channels_in: int, channels: int, blocks: int, stride: int = 1, dilation: int = 1
) -> nn.Sequential:
    """Blocks of one layer; the first halves the dilation and has a convolution as shortcut."""
    wide = channels * Bottleneck.expansion
    first_dilation = max(1, dilation // 2)
    downsample = Layers(_shortcut(channels_in, wide, stride, dilation), nn.BatchNorm2d(wide))
    first = Bottleneck(channels_in, channels, stride, first_dilation, downsample)
    rest = (Bottleneck(wide, channels, dilation=dilation) for _ in range(blocks - 1))
    return nn.Sequential(first, *rest)


def _shortcut(channels_in: int, channels: int, stride: int, dilation: int) -> nn.Conv2d:
    """1x1 in the plain layer; a 3x3 that keeps step with the dilated ones elsewhere."""
    if stride == 1 and dilation == 1:
        return nn.Conv2d(channels_in, channels, 1, bias=False)
    if stride == 2:
        return nn.Conv2d(channels_in, channels, 3, stride=2, bias=False)
    half = dilation // 2
    return nn.Conv2d(channels_in, channels, 3, padding=half, dilation=half, bias=False)
