"""SiamAPN (Fu et al., ICRA 2021) with its layers written plainly, as a yardstick for speed.

What the official code computes in its order, in the default memory layout; of the template the
features are kept, the kernels are computed in every frame. One sequence at a time.
"""

import torch
import torch.nn.functional as F
from peers.hift import Backbone, correlate
from torch import Tensor, nn

Features = tuple[Tensor, Tensor]


def conv(before: int, after: int, padding: int = 0, size: int = 3) -> nn.Sequential:
    """Convolution, batch norm, ReLU."""
    convolution = nn.Conv2d(before, after, size, padding=padding)
    return nn.Sequential(convolution, nn.BatchNorm2d(after), nn.ReLU(inplace=True))


def tower(count: int) -> list[nn.Module]:
    """Layers that keep the size of the map."""
    layers: list[nn.Module] = []
    for _ in range(count):
        layers += [nn.Conv2d(256, 256, 3, padding=1), nn.GroupNorm(32, 256), nn.ReLU(inplace=True)]
    return layers


def shrink(before: int) -> nn.Sequential:
    """From 21 cells to 19."""
    return nn.Sequential(
        nn.Conv2d(before, 256, 3, padding=1),
        nn.GroupNorm(32, 256),
        nn.ReLU(inplace=True),
        nn.Conv2d(256, 256, 3),
    )


class Grader(nn.Module):
    """Anchor proposal."""

    def __init__(self) -> None:
        super().__init__()
        self.conv_shape = conv(384, 384, padding=1)
        self.conv_shape.append(nn.Conv2d(384, 4, 3, padding=1))
        self.conv1 = conv(384, 384)
        self.conv2 = conv(384, 384)

    def forward(self, x: Features, z: Features) -> tuple[Tensor, Tensor]:
        """The sides of the anchors and the correlation."""
        correlation = correlate(self.conv1(x[0]), self.conv2(z[0]))
        return self.conv_shape(correlation), correlation


class Heads(nn.Module):
    """Classes and boxes."""

    def __init__(self) -> None:
        super().__init__()
        self.conv1, self.conv2 = conv(256, 256), conv(256, 256)
        self.convloc = nn.Sequential(*tower(2), nn.Conv2d(256, 4, 3, padding=1))
        self.convcls = nn.Sequential(*tower(2))
        self.conv_offset = shrink(384)
        self.add = nn.ConvTranspose2d(512, 256, 3)
        self.resize = shrink(256)
        self.cls1 = nn.Conv2d(256, 2, 3, padding=1)
        self.cls2 = nn.Conv2d(256, 2, 3, padding=1)
        self.cls3 = nn.Conv2d(256, 1, 3, padding=1)

    def forward(self, x: Features, z: Features, proposed: Tensor) -> tuple[Tensor, ...]:
        """cls1, cls2, cls3, loc."""
        resized = self.resize(correlate(self.conv1(x[1]), self.conv2(z[1])))
        both = torch.cat((resized, self.conv_offset(proposed)), dim=1)
        joined = self.add(F.relu(both))
        classes = self.convcls(joined)
        return self.cls1(classes), self.cls2(classes), self.cls3(classes), self.convloc(joined)


class Peer(nn.Module):
    """The network; features of the template are kept from frame to frame."""

    def __init__(self, grader: nn.Module, heads: nn.Module) -> None:
        super().__init__()
        self.backbone = Backbone()
        self.grader = grader
        self.new = heads

    def embed(self, template: Tensor) -> Features:
        """Once a sequence: what is kept of the template crop."""
        _, fourth, fifth = self.backbone(template)
        return fourth, fifth

    def match(self, features: Features, search: Tensor) -> tuple[Tensor, ...]:
        """Once a frame."""
        of_search = self.embed(search)
        anchors, proposed = self.grader(of_search, features)
        return (*self.new(of_search, features, proposed), anchors)

    def forward(self, template: Tensor, search: Tensor) -> tuple[Tensor, ...]:
        """cls1, cls2, cls3, loc, anchors of crops (1, 3, 127, 127) and (1, 3, 287, 287)."""
        return self.match(self.embed(template), search)


def build() -> nn.Module:
    """The network in eval mode, with the official checkpoint's keys."""
    return Peer(Grader(), Heads()).eval()
