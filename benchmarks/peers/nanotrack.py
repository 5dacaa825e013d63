"""NanoTrack (HonglinChu, SiamTrackers) with its layers written plainly, as a yardstick for speed.

What the official code computes in its order: a batch norm after each convolution, hard swish from
ReLU6, template-side convolutions in every frame, default memory layout. One sequence at a time.
"""

from collections.abc import Sequence

import torch
import torch.nn.functional as F
from torch import Tensor, nn

BLOCKS = (
    # kernel, inner channels, outer channels, inner of squeeze and excite, hard swish, stride
    (3, 16, 16, 8, False, 2),
    (3, 72, 24, 0, False, 2),
    (3, 88, 24, 0, False, 1),
    (5, 96, 40, 24, True, 2),
    (5, 240, 40, 64, True, 1),
    (5, 240, 40, 64, True, 1),
    (5, 120, 48, 32, True, 1),
    (5, 144, 48, 40, True, 1),
    (5, 288, 96, 72, True, 1),
)


class HardSigmoid(nn.Module):
    """A line from 0 to 1 between -3 and 3."""

    def forward(self, x: Tensor) -> Tensor:
        """Any shape to the same."""
        return F.relu6(x + 3) / 6


class HardSwish(nn.Module):
    """The input times its hard sigmoid."""

    def forward(self, x: Tensor) -> Tensor:
        """Any shape to the same."""
        return x * F.relu6(x + 3) / 6


class Squeeze(nn.Module):
    """Squeeze and excite."""

    def __init__(self, channels: int, inner: int) -> None:
        super().__init__()
        squeeze, excite = nn.Linear(channels, inner), nn.Linear(inner, channels)
        self.fc = nn.Sequential(squeeze, nn.ReLU(), excite, HardSigmoid())

    def forward(self, x: Tensor) -> Tensor:
        """(1, c, h, w) to the same shape."""
        means = F.adaptive_avg_pool2d(x, 1).flatten(1)
        return x * self.fc(means)[:, :, None, None].expand_as(x)


class Block(nn.Module):
    """Inverted residual."""

    def __init__(self, before: int, row: tuple[int, int, int, int, bool, int]) -> None:
        super().__init__()
        kernel, inner, after, squeezed, swish, stride = row
        self.adds = stride == 1 and before == after
        activation = HardSwish if swish else nn.ReLU
        squeeze = Squeeze(inner, squeezed) if squeezed else nn.Identity()
        depthwise = depth(inner, kernel, stride, kernel // 2)
        if inner == before:
            layers = [depthwise, nn.BatchNorm2d(inner), activation(), squeeze]
        else:
            wide = [nn.Conv2d(before, inner, 1, bias=False), nn.BatchNorm2d(inner), activation()]
            layers = [*wide, depthwise, nn.BatchNorm2d(inner), squeeze, activation()]
        last = [nn.Conv2d(inner, after, 1, bias=False), nn.BatchNorm2d(after)]
        self.conv = nn.Sequential(*layers, *last)

    def forward(self, x: Tensor) -> Tensor:
        """One map to the next."""
        return x + self.conv(x) if self.adds else self.conv(x)


def depth(channels: int, size: int, stride: int = 1, padding: int = 0) -> nn.Conv2d:
    """Depthwise convolution."""
    return nn.Conv2d(channels, channels, size, stride, padding, groups=channels, bias=False)


class Backbone(nn.Module):
    """MobileNetV3-small to stride 16."""

    def __init__(self, count: int) -> None:
        super().__init__()
        first = nn.Conv2d(3, 16, 3, 2, 1, bias=False)
        layers: list[nn.Module] = [nn.Sequential(first, nn.BatchNorm2d(16), HardSwish())]
        for before, row in zip((16, *(row[2] for row in BLOCKS)), BLOCKS[:count], strict=False):
            layers.append(Block(before, row))
        self.features = nn.Sequential(*layers)

    def forward(self, crop: Tensor) -> Tensor:
        """Features of a crop (1, 3, S, S)."""
        return self.features(crop)


class Attention(nn.Module):
    """A factor for each channel."""

    def __init__(self) -> None:
        super().__init__()
        self.fc1, self.fc2 = nn.Conv2d(64, 64, 1), nn.Conv2d(64, 64, 1)

    def forward(self, x: Tensor) -> Tensor:
        """(1, 64, h, w) to the same shape."""
        return x * torch.sigmoid(self.fc2(F.relu(self.fc1(F.adaptive_avg_pool2d(x, 1)))))


def project(channels: int) -> nn.Sequential:
    """1x1 and batch norm."""
    return nn.Sequential(nn.Conv2d(channels, channels, 1), nn.BatchNorm2d(channels))


def separable(channels: int, size: int, padding: int, *, bias: bool) -> list[nn.Module]:
    """Depthwise and 1x1, a batch norm after each."""
    return [
        depth(channels, size, 1, padding),
        nn.BatchNorm2d(channels),
        nn.ReLU6(inplace=True),
        nn.Conv2d(channels, channels, 1, bias=bias),
        nn.BatchNorm2d(channels),
    ]


class PixelWise(nn.Module):
    """Pixel-wise correlation, with what versions 2 and 3 put around it."""

    def __init__(self, version: int, channels: int) -> None:
        super().__init__()
        self.version = version
        self.CA_layer = Attention()
        if version > 1:
            self.conv_kernel, self.conv_search = project(channels), project(channels)
        if version == 3:
            self.conv = nn.Sequential(*separable(64, 2, 0, bias=True))

    def forward(self, search: Tensor, template: Tensor) -> Tensor:
        """64 maps."""
        if self.version > 1:
            template, search = self.conv_kernel(template), self.conv_search(search)
        count, channels, height, width = search.shape
        kernel = template.reshape(count, channels, -1).permute(0, 2, 1)
        product = torch.matmul(kernel, search.reshape(count, channels, -1))
        found = self.CA_layer(product.reshape(count, -1, height, width))
        return self.conv(found) if self.version == 3 else found


class DepthWise(nn.Module):
    """Depthwise correlation with the centre of the template."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.conv_kernel, self.conv_search = project(channels), project(channels)

    def forward(self, search: Tensor, template: Tensor) -> Tensor:
        """A map for each channel."""
        kernel = self.conv_kernel(template[:, :, 2:6, 2:6]).transpose(0, 1)
        return F.conv2d(self.conv_search(search), kernel, padding=1, groups=kernel.shape[0])


def tower(widths: Sequence[int], sizes: Sequence[int]) -> nn.Sequential:
    """Versions 1 and 2."""
    layers: list[nn.Module] = []
    for before, after, size in zip(widths, widths[1:], sizes, strict=False):
        layers += [depth(before, size, 1, size // 2), nn.Conv2d(before, after, 1, bias=False)]
        layers += [nn.BatchNorm2d(after), nn.ReLU6(inplace=True)]
    return nn.Sequential(*layers)


def tower_v3() -> nn.Sequential:
    """Version 3."""
    return nn.Sequential(*[x for _ in range(6) for x in separable(96, 3, 1, bias=False)])


class HeadV1(nn.Module):
    """One correlation, two towers."""

    def __init__(self) -> None:
        super().__init__()
        self.corr_pw = PixelWise(1, 48)
        self.cls_tower = tower((64, 128, 128, 128), (5, 5, 3))
        self.bbox_tower = tower((64, 96, 96, 96, 96), (3, 3, 5, 5))
        self.cls_logits = nn.Sequential(nn.Conv2d(128, 2, 1))
        self.bbox_pred = nn.Sequential(nn.Conv2d(96, 4, 1))

    def forward(self, z: Tensor, x: Tensor) -> tuple[Tensor, Tensor]:
        """The maps."""
        found = self.corr_pw(x, z)
        classes = self.cls_logits(self.cls_tower(found))
        return classes, torch.exp(self.bbox_pred(self.bbox_tower(found)))


class HeadV2(nn.Module):
    """A correlation for each tower."""

    def __init__(self) -> None:
        super().__init__()
        self.corr_pw_reg, self.corr_pw_cls = PixelWise(2, 48), PixelWise(2, 48)
        self.cls_pw_tower = tower((64, *[96] * 6), [3] * 6)
        self.bbox_pw_tower = tower((64, *[96] * 6), [3] * 6)
        self.cls_pred = nn.Sequential(nn.Conv2d(96, 2, 1))
        self.bbox_pred = nn.Sequential(nn.Conv2d(96, 4, 1))

    def forward(self, z: Tensor, x: Tensor) -> tuple[Tensor, Tensor]:
        """The maps."""
        boxes = self.bbox_pred(self.bbox_pw_tower(self.corr_pw_reg(x, z)))
        return self.cls_pred(self.cls_pw_tower(self.corr_pw_cls(x, z))), torch.exp(boxes)


class HeadV3(nn.Module):
    """Two correlations for each tower."""

    def __init__(self) -> None:
        super().__init__()
        self.corr_dw_reg, self.corr_pw_reg = DepthWise(96), PixelWise(3, 96)
        self.corr_dw_cls, self.corr_pw_cls = DepthWise(96), PixelWise(3, 96)
        self.cls_tower, self.bbox_tower = tower_v3(), tower_v3()
        self.cls_logits = nn.Sequential(nn.Conv2d(96, 2, 1))
        self.bbox_pred = nn.Sequential(nn.Conv2d(96, 4, 1))
        self.down_reg = nn.Sequential(nn.Conv2d(160, 96, 1))
        self.down_cls = nn.Sequential(nn.Conv2d(160, 96, 1))

    def forward(self, z: Tensor, x: Tensor) -> tuple[Tensor, Tensor]:
        """The maps."""
        reg = torch.cat([self.corr_pw_reg(x, z), self.corr_dw_reg(x, z)], dim=1)
        cls = torch.cat([self.corr_pw_cls(x, z), self.corr_dw_cls(x, z)], dim=1)
        boxes = self.bbox_pred(self.bbox_tower(self.down_reg(reg)))
        return self.cls_logits(self.cls_tower(self.down_cls(cls))), torch.exp(boxes)


class Neck(nn.Module):
    """In the checkpoints, not in use."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        layer = nn.Conv2d(channels, channels, 1, bias=False)
        self.downsample = nn.Sequential(layer, nn.BatchNorm2d(channels))


class Peer(nn.Module):
    """The network."""

    def __init__(self, variant: str) -> None:
        super().__init__()
        self.backbone = Backbone(9 if variant == "v3" else 8)
        self.neck = Neck(96 if variant == "v3" else 64)
        self.ban_head = {"v1": HeadV1, "v2": HeadV2, "v3": HeadV3}[variant]()

    def embed(self, template: Tensor) -> Tensor:
        """What is kept of a template crop (1, 3, 127, 127)."""
        return self.backbone(template)

    def match(self, features: Tensor, search: Tensor) -> tuple[Tensor, Tensor]:
        """The maps of a search crop (1, 3, 255, 255)."""
        maps: tuple[Tensor, Tensor] = self.ban_head(features, self.backbone(search))
        return maps

    def forward(self, template: Tensor, search: Tensor) -> tuple[Tensor, Tensor]:
        """The maps of a pair of crops."""
        return self.match(self.embed(template), search)


def build(variant: str = "v3") -> nn.Module:
    """The network in eval mode, with the official checkpoint's keys."""
    return Peer(variant).eval()
