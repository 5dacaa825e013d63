"""The heads of NanoTrack: pixel-wise correlation, and towers of depthwise and 1x1 convolutions.

Every head has `embed`, the part that depends on the template only, and `forward`, which takes what
`embed` gave and the search features to (cls, loc): logits (n, 2, map, map), and distances in crop
pixels (n, 4, map, map), the exponential of what the last layer gives.
"""

from collections.abc import Sequence
from typing import TypeAlias

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from nat2024_trackers.siamese.correlation import depthwise_correlation

Kernels: TypeAlias = tuple[Tensor, ...]

_CELLS = 64
"""Template positions, 8x8: so many channels a pixel-wise correlation has."""


def _projection(channels: int) -> nn.Sequential:
    return nn.Sequential(nn.Conv2d(channels, channels, 1), nn.BatchNorm2d(channels))


def _depthwise(channels: int, size: int, padding: int) -> nn.Conv2d:
    return nn.Conv2d(channels, channels, size, padding=padding, groups=channels, bias=False)


def _tower(channels: Sequence[int], sizes: Sequence[int]) -> nn.Sequential:
    """Depthwise, 1x1, batch norm, ReLU6 for each size (versions 1 and 2)."""
    layers: list[nn.Module] = []
    for before, after, size in zip(channels, channels[1:], sizes, strict=False):
        layers += [
            _depthwise(before, size, size // 2),
            nn.Conv2d(before, after, 1, bias=False),
            nn.BatchNorm2d(after),
            nn.ReLU6(inplace=True),
        ]
    return nn.Sequential(*layers)


def _separable(channels: int, size: int, padding: int, *, bias: bool) -> list[nn.Module]:
    """Depthwise, batch norm, ReLU6, 1x1, batch norm (version 3)."""
    return [
        _depthwise(channels, size, padding),
        nn.BatchNorm2d(channels),
        nn.ReLU6(inplace=True),
        nn.Conv2d(channels, channels, 1, bias=bias),
        nn.BatchNorm2d(channels),
    ]


class ChannelAttention(nn.Module):
    """A factor 0..1 for each channel, from the means of all."""

    def __init__(self, channels: int) -> None:
        """Build with fresh weights."""
        super().__init__()
        self.fc1 = nn.Conv2d(channels, channels, 1)
        self.fc2 = nn.Conv2d(channels, channels, 1)

    def forward(self, x: Tensor) -> Tensor:
        """(n, channels, h, w) to the same shape."""
        inner = F.relu(self.fc1(x.mean((2, 3), keepdim=True)))
        return x * torch.sigmoid(self.fc2(inner))


class PixelCorrelation(nn.Module):
    """Each of the 64 channels is the dot product of one template position with every search one.

    Where `channels` is given, both inputs are projected first (versions 2 and 3); where `shrinks`,
    a 2x2 layer without padding takes 16 cells to 15 (version 3).
    """

    def __init__(self, channels: int = 0, *, shrinks: bool = False) -> None:
        """Build with fresh weights."""
        super().__init__()
        self.CA_layer = ChannelAttention(_CELLS)
        self.conv_kernel: nn.Module = _projection(channels) if channels else nn.Identity()
        self.conv_search: nn.Module = _projection(channels) if channels else nn.Identity()
        block = nn.Sequential(*_separable(_CELLS, 2, 0, bias=True))
        self.conv: nn.Module = block if shrinks else nn.Identity()

    def embed(self, template: Tensor) -> Tensor:
        """(n, c, 8, 8) to the kernel (n, c, 64)."""
        kernel: Tensor = self.conv_kernel(template)
        return kernel.flatten(2).contiguous()

    def forward(self, kernel: Tensor, search: Tensor) -> Tensor:
        """(n, 64, h, w) of search features (n, c, h, w), or one cell less along each side."""
        projected = self.conv_search(search)
        # Positions before channels: the product is channels-last without a copy.
        product = projected.flatten(2).transpose(1, 2) @ kernel
        found: Tensor = product.transpose(1, 2).unflatten(2, projected.shape[2:])
        return self.conv(self.CA_layer(found))  # type: ignore[no-any-return]


class DepthwiseCorrelation(nn.Module):
    """Correlation of every channel with the central 4x4 of the template, padded by one cell."""

    def __init__(self, channels: int) -> None:
        """Build with fresh weights."""
        super().__init__()
        self.conv_kernel = _projection(channels)
        self.conv_search = _projection(channels)

    def embed(self, template: Tensor) -> Tensor:
        """(n, c, 8, 8) to the kernel (n, c, 4, 4)."""
        kernel: Tensor = self.conv_kernel(template[:, :, 2:6, 2:6])
        return kernel

    def forward(self, kernel: Tensor, search: Tensor) -> Tensor:
        """(n, c, h - 1, w - 1) of search features (n, c, h, w)."""
        return depthwise_correlation(F.pad(self.conv_search(search), (1, 1, 1, 1)), kernel)


class HeadV1(nn.Module):
    """One correlation for both towers."""

    def __init__(self, channels: int) -> None:
        """Build with fresh weights; the features enter as they are, whatever their channels."""
        super().__init__()
        del channels
        self.corr_pw = PixelCorrelation()
        self.cls_tower = _tower((_CELLS, 128, 128, 128), (5, 5, 3))
        self.bbox_tower = _tower((_CELLS, 96, 96, 96, 96), (3, 3, 5, 5))
        self.cls_logits = nn.Sequential(nn.Conv2d(128, 2, 1))
        self.bbox_pred = nn.Sequential(nn.Conv2d(96, 4, 1))

    def embed(self, template: Tensor) -> Kernels:
        """The kernel of the correlation."""
        return (self.corr_pw.embed(template),)

    def forward(self, kernels: Kernels, search: Tensor) -> tuple[Tensor, Tensor]:
        """(cls, loc) maps."""
        found = self.corr_pw(kernels[0], search)
        logits = self.cls_logits(self.cls_tower(found))
        return logits, self.bbox_pred(self.bbox_tower(found)).exp()


class HeadV2(nn.Module):
    """A correlation for each tower, of projected features."""

    def __init__(self, channels: int) -> None:
        """Build with fresh weights for features of so many channels."""
        super().__init__()
        widths = (_CELLS, *[96] * 6)
        self.corr_pw_reg = PixelCorrelation(channels)
        self.corr_pw_cls = PixelCorrelation(channels)
        self.cls_pw_tower = _tower(widths, [3] * 6)
        self.bbox_pw_tower = _tower(widths, [3] * 6)
        self.cls_pred = nn.Sequential(nn.Conv2d(96, 2, 1))
        self.bbox_pred = nn.Sequential(nn.Conv2d(96, 4, 1))

    def embed(self, template: Tensor) -> Kernels:
        """Kernels of both correlations: reg, cls."""
        return self.corr_pw_reg.embed(template), self.corr_pw_cls.embed(template)

    def forward(self, kernels: Kernels, search: Tensor) -> tuple[Tensor, Tensor]:
        """(cls, loc) maps."""
        distances = self.bbox_pred(self.bbox_pw_tower(self.corr_pw_reg(kernels[0], search)))
        logits = self.cls_pred(self.cls_pw_tower(self.corr_pw_cls(kernels[1], search)))
        return logits, distances.exp()


class HeadV3(nn.Module):
    """A pixel-wise and a depthwise correlation for each tower, reduced by a 1x1."""

    def __init__(self, channels: int) -> None:
        """Build with fresh weights for features of so many channels."""
        super().__init__()
        self.corr_dw_reg = DepthwiseCorrelation(channels)
        self.corr_pw_reg = PixelCorrelation(channels, shrinks=True)
        self.corr_dw_cls = DepthwiseCorrelation(channels)
        self.corr_pw_cls = PixelCorrelation(channels, shrinks=True)
        self.cls_tower = _tower_v3(channels)
        self.bbox_tower = _tower_v3(channels)
        self.cls_logits = nn.Sequential(nn.Conv2d(channels, 2, 1))
        self.bbox_pred = nn.Sequential(nn.Conv2d(channels, 4, 1))
        self.down_reg = nn.Sequential(nn.Conv2d(_CELLS + channels, channels, 1))
        self.down_cls = nn.Sequential(nn.Conv2d(_CELLS + channels, channels, 1))

    def embed(self, template: Tensor) -> Kernels:
        """Kernels of all correlations: pixel-wise reg, depthwise reg, then cls."""
        return (
            self.corr_pw_reg.embed(template),
            self.corr_dw_reg.embed(template),
            self.corr_pw_cls.embed(template),
            self.corr_dw_cls.embed(template),
        )

    def forward(self, kernels: Kernels, search: Tensor) -> tuple[Tensor, Tensor]:
        """(cls, loc) maps."""
        pw_reg, dw_reg, pw_cls, dw_cls = kernels
        reg = [self.corr_pw_reg(pw_reg, search), self.corr_dw_reg(dw_reg, search)]
        cls = [self.corr_pw_cls(pw_cls, search), self.corr_dw_cls(dw_cls, search)]
        distances = self.bbox_pred(self.bbox_tower(self.down_reg(torch.cat(reg, dim=1))))
        logits = self.cls_logits(self.cls_tower(self.down_cls(torch.cat(cls, dim=1))))
        return logits, distances.exp()


def _tower_v3(channels: int) -> nn.Sequential:
    return nn.Sequential(
        *[layer for _ in range(6) for layer in _separable(channels, 3, 1, bias=False)]
    )


HEADS: dict[str, type[HeadV1] | type[HeadV2] | type[HeadV3]] = {
    "v1": HeadV1,
    "v2": HeadV2,
    "v3": HeadV3,
}
