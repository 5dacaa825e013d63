"""SiamAPN++ (Cao et al., IROS 2021) with its layers written plainly, as a yardstick for speed.

What the official code computes in its order, in the default memory layout; of the template the
features are kept, the kernels are computed in every frame. One sequence at a time.
"""

import torch
import torch.nn.functional as F
from peers.hift import correlate
from peers.siamapn import Features, Peer, conv, tower
from torch import Tensor, nn


def bottleneck() -> tuple[nn.Conv2d, nn.Conv2d]:
    """Two layers that weigh channels."""
    return nn.Conv2d(256, 42, 1, bias=False), nn.Conv2d(42, 256, 1, bias=False)


class Aggregation(nn.Module):
    """One map strengthened by another."""

    def __init__(self) -> None:
        super().__init__()
        self.gamma1, self.gamma3 = (nn.Parameter(torch.zeros(1)) for _ in range(2))
        self.add = nn.ConvTranspose2d(512, 256, 1)
        self.fc1, self.fc2 = bottleneck()

    def forward(self, x: Tensor, z: Tensor) -> Tensor:
        """Two maps to one."""
        weight = torch.sigmoid(self.fc2(F.relu(self.fc1(F.adaptive_avg_pool2d(z, 1)))))
        joined = F.relu(self.add(torch.cat((x, z), dim=1)))
        return x + self.gamma1 * joined + self.gamma3 * (weight * x)


class Channel(nn.Module):
    """Channel attention, with a layer that is never used."""

    def __init__(self) -> None:
        super().__init__()
        self.gamma2 = nn.Parameter(torch.zeros(1))
        self.conv1 = conv(256, 256, padding=3, size=7)
        self.fc1, self.fc2 = bottleneck()

    def forward(self, x: Tensor) -> Tensor:
        """Keeps the shape."""
        mean = self.fc2(F.relu(self.fc1(F.adaptive_avg_pool2d(x, 1))))
        largest = self.fc2(F.relu(self.fc1(F.adaptive_max_pool2d(x, 1))))
        return x + self.gamma2 * (torch.sigmoid(largest + mean) * x)


class Point(nn.Module):
    """Self-attention between cells."""

    def __init__(self) -> None:
        super().__init__()
        self.gamma = nn.Parameter(torch.zeros(1))
        self.query_conv = nn.Conv2d(256, 32, 1)
        self.key_conv = nn.Conv2d(256, 32, 1)
        self.value_conv = nn.Conv2d(256, 256, 1)

    def forward(self, x: Tensor) -> Tensor:
        """Keeps the shape."""
        count, channels, height, width = x.shape
        query = self.query_conv(x).view(count, -1, height * width).permute(0, 2, 1)
        key = self.key_conv(x).view(count, -1, height * width)
        attention = torch.bmm(query, key).softmax(dim=-1)
        value = self.value_conv(x).view(count, -1, height * width)
        mixed = torch.bmm(value, attention.permute(0, 2, 1)).view(count, channels, height, width)
        return self.gamma * mixed + x


class Grader(nn.Module):
    """Anchor proposal."""

    def __init__(self) -> None:
        super().__init__()
        self.conv_shape = conv(256, 256, padding=1)
        self.anchor = nn.Conv2d(256, 4, 3, padding=1)
        self.conv3 = conv(384, 256, padding=1)
        self.conv5, self.conv6 = conv(256, 256, padding=1), conv(256, 256, padding=1)
        self.adcat = Aggregation()

    def forward(self, x: Features, z: Features) -> tuple[Tensor, Tensor]:
        """The sides of the anchors and the joined correlations."""
        earlier = self.conv3(correlate(x[0], z[0]))
        later = correlate(self.conv5(x[1]), self.conv6(z[1]))
        joined = self.adcat(later, earlier)
        return self.anchor(self.conv_shape(joined)), joined


class Heads(nn.Module):
    """Classes and boxes."""

    def __init__(self) -> None:
        super().__init__()
        self.conv1, self.conv2, self.conv4 = (conv(256, 256, padding=1) for _ in range(3))
        self.convloc = nn.Sequential(*tower(4), nn.Conv2d(256, 4, 3, padding=1))
        self.convcls = nn.Sequential(*tower(2))
        self.channel = Channel()
        self.point = Point()
        self.cls1 = nn.Conv2d(256, 2, 3, padding=1)
        self.cls2 = nn.Conv2d(256, 2, 3, padding=1)
        self.cls3 = nn.Conv2d(256, 1, 3, padding=1)
        self.adcat = Aggregation()

    def forward(self, x: Features, z: Features, proposed: Tensor) -> tuple[Tensor, ...]:
        """cls1, cls2, cls3, loc."""
        found = correlate(self.conv1(x[1]), self.conv2(z[1]))
        joined = self.adcat(self.conv4(self.channel(self.point(found))), proposed)
        classes = self.convcls(joined)
        return self.cls1(classes), self.cls2(classes), self.cls3(classes), self.convloc(joined)


def build() -> nn.Module:
    """The network in eval mode, with the official checkpoint's keys."""
    return Peer(Grader(), Heads()).eval()
