"""The network of SiamRPN++: backbone, neck, depthwise cross-correlation heads.

Source: Li et al., CVPR 2019, sections 3.2 to 3.4; key names and shapes as in the checkpoints of
STVIR/pysot. Crops are float32 (n, 3, side, side), 0..255, BGR, without mean or scale.
"""

from typing import TypeAlias

import torch
from torch import Tensor, nn

from nat2024_trackers.siamese.correlation import depthwise_correlation
from nat2024_trackers.siamese.layers import Layers, conv_batch_norm
from nat2024_trackers.siamrpnpp.alexnet import AlexNet
from nat2024_trackers.siamrpnpp.mobilenet import MobileNetV2
from nat2024_trackers.siamrpnpp.resnet import ResNet50
from nat2024_trackers.siamrpnpp.variants import ANCHORS, Backbone, Variant

Kernels: TypeAlias = tuple[Tensor, ...]
"""Template side of the heads: for each level the kernel of cls, then of loc."""

_BACKBONES: dict[Backbone, type[AlexNet] | type[MobileNetV2] | type[ResNet50]] = {
    "alexnet": AlexNet,
    "mobilenetv2": MobileNetV2,
    "resnet50": ResNet50,
}
_HEAD_CHANNELS = 256
_TEMPLATE_LIMIT = 20
_TEMPLATE_CELLS = 7


class DepthwiseXCorr(nn.Module):
    """One branch of a head: template and search convolutions, correlation, 1x1 layers."""

    def __init__(self, channels: int, channels_out: int) -> None:
        """Build with fresh weights."""
        super().__init__()
        self.conv_kernel = Layers(*conv_batch_norm(channels, channels, bias=False))
        self.conv_search = Layers(*conv_batch_norm(channels, channels, bias=False))
        self.head = Layers(
            *conv_batch_norm(channels, channels, size=1, bias=False),
            nn.Conv2d(channels, channels_out, 1),
        )

    def embed(self, template: Tensor) -> Tensor:
        """The kernel, (n, c, s - 2, s - 2), of template features (n, c, s, s)."""
        kernel: Tensor = self.conv_kernel(template)
        return kernel

    def forward(self, kernel: Tensor, search: Tensor) -> Tensor:
        """Maps of search features under a kernel from `embed`."""
        maps: Tensor = self.head(depthwise_correlation(self.conv_search(search), kernel))
        return maps


class DepthwiseRPN(nn.Module):
    """A region proposal head: a branch for classes, a branch for box offsets."""

    def __init__(self, channels: int, anchors: int = ANCHORS) -> None:
        """Build with fresh weights."""
        super().__init__()
        self.cls = DepthwiseXCorr(channels, 2 * anchors)
        self.loc = DepthwiseXCorr(channels, 4 * anchors)

    def embed(self, levels: list[Tensor]) -> Kernels:
        """Kernels of both branches."""
        [template] = levels
        return self.cls.embed(template), self.loc.embed(template)

    def forward(self, kernels: Kernels, levels: list[Tensor]) -> tuple[Tensor, Tensor]:
        """(cls, loc) maps."""
        [search] = levels
        return self.cls(kernels[0], search), self.loc(kernels[1], search)


class MultiLevelRPN(nn.Module):
    """A head for each of the backbone's layers 2, 3 and 4, and the mean of their maps.

    Where `weighted`, the mean is weighted by the softmax of `cls_weight` and `loc_weight`.
    """

    def __init__(self, channels: int, levels: int, *, weighted: bool) -> None:
        """Build with fresh weights."""
        super().__init__()
        self.weighted = weighted
        for number in range(levels):
            self.add_module(f"rpn{number + 2}", DepthwiseRPN(channels))
        if weighted:
            self.cls_weight = nn.Parameter(torch.ones(levels))
            self.loc_weight = nn.Parameter(torch.ones(levels))

    def embed(self, levels: list[Tensor]) -> Kernels:
        """Kernels of all heads: cls, loc of layer 2, then of layers 3 and 4."""
        kernels: list[Tensor] = []
        for number, template in enumerate(levels):
            kernels.extend(self._head(number).embed([template]))
        return tuple(kernels)

    def forward(self, kernels: Kernels, levels: list[Tensor]) -> tuple[Tensor, Tensor]:
        """(cls, loc) maps, averaged over the levels."""
        maps = [
            self._head(number)(kernels[2 * number : 2 * number + 2], [search])
            for number, search in enumerate(levels)
        ]
        classes, offsets = zip(*maps, strict=True)
        if not self.weighted:
            return torch.stack(classes).mean(0), torch.stack(offsets).mean(0)
        return _weighted(classes, self.cls_weight), _weighted(offsets, self.loc_weight)

    def _head(self, number: int) -> DepthwiseRPN:
        head = self.get_submodule(f"rpn{number + 2}")
        assert isinstance(head, DepthwiseRPN)
        return head


def _weighted(maps: tuple[Tensor, ...], weight: Tensor) -> Tensor:
    shares = weight.softmax(0)
    return torch.stack([one * share for one, share in zip(maps, shares, strict=True)]).sum(0)


class AdjustLayer(nn.Module):
    """1x1 convolution to the head's channels; maps of a template lose their border."""

    def __init__(self, channels_in: int, channels_out: int) -> None:
        """Build with fresh weights."""
        super().__init__()
        self.downsample = Layers(
            nn.Conv2d(channels_in, channels_out, 1, bias=False), nn.BatchNorm2d(channels_out)
        )

    def forward(self, features: Tensor) -> Tensor:
        """(n, c, s, s) to (n, channels_out, s, s), or to the central 7x7 where s is below 20."""
        adjusted: Tensor = self.downsample(features)
        if adjusted.shape[3] < _TEMPLATE_LIMIT:
            first = (adjusted.shape[3] - _TEMPLATE_CELLS) // 2
            last = first + _TEMPLATE_CELLS
            return adjusted[:, :, first:last, first:last]
        return adjusted


class Neck(nn.Module):
    """An adjust layer for each of the backbone's layers 2, 3 and 4."""

    def __init__(self, channels_in: tuple[int, ...], channels_out: int) -> None:
        """Build with fresh weights."""
        super().__init__()
        for number, channels in enumerate(channels_in):
            self.add_module(f"downsample{number + 2}", AdjustLayer(channels, channels_out))

    def forward(self, levels: list[Tensor]) -> list[Tensor]:
        """The adjusted maps."""
        return [
            self.get_submodule(f"downsample{number + 2}")(features)
            for number, features in enumerate(levels)
        ]


class SiamRPN(nn.Module):
    """The whole network; `state_dict()` has the official keys and shapes."""

    def __init__(self, variant: Variant) -> None:
        """Build a variant with fresh weights."""
        super().__init__()
        backbone = _BACKBONES[variant.backbone]()
        self.backbone: nn.Module = backbone
        self.neck: nn.Module = nn.Identity()
        self.rpn_head: DepthwiseRPN | MultiLevelRPN
        if len(backbone.channels) == 1:
            self.rpn_head = DepthwiseRPN(backbone.channels[0])
        else:
            self.neck = Neck(backbone.channels, _HEAD_CHANNELS)
            levels = len(backbone.channels)
            self.rpn_head = MultiLevelRPN(_HEAD_CHANNELS, levels, weighted=variant.weighted)

    def embed(self, template: Tensor) -> Kernels:
        """Head kernels of template crops (n, 3, 127, 127); constant through a sequence."""
        return self.rpn_head.embed(self.neck(self.backbone(template)))

    def match(self, kernels: Kernels, search: Tensor) -> tuple[Tensor, Tensor]:
        """(cls, loc): (n, 10, map, map) and (n, 20, map, map) of search crops."""
        maps: tuple[Tensor, Tensor] = self.rpn_head(kernels, self.neck(self.backbone(search)))
        return maps

    def forward(self, template: Tensor, search: Tensor) -> tuple[Tensor, Tensor]:
        """Both sides at once, as training needs it."""
        return self.match(self.embed(template), search)
