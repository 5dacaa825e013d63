"""The network of SiamAPN++.

Source: Cao et al., IROS 2021, section III, and `SiamAPN++/` of vision4robotics/SiamAPN.
"""

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from nat2024_trackers.siamapn.network import (
    CHANNELS,
    STAGE4_CHANNELS,
    Kernels,
    Maps,
    ProposalHead,
    ProposalNetwork,
    ScoreHeads,
)
from nat2024_trackers.siamese.correlation import depthwise_correlation
from nat2024_trackers.siamese.layers import Layers, conv_batch_norm, tower

_SQUEEZED = CHANNELS // 6
_TOKEN_CHANNELS = CHANNELS // 8


def _squeeze() -> nn.Conv2d:
    return nn.Conv2d(CHANNELS, _SQUEEZED, 1, bias=False)


def _excite() -> nn.Conv2d:
    return nn.Conv2d(_SQUEEZED, CHANNELS, 1, bias=False)


class CrossAggregation(nn.Module):
    """`adcat`: one map strengthened by another, as a whole and channel by channel."""

    def __init__(self) -> None:
        """Build with fresh weights; both factors start at zero."""
        super().__init__()
        self.gamma1 = nn.Parameter(torch.zeros(1))
        self.gamma3 = nn.Parameter(torch.zeros(1))
        self.add = nn.ConvTranspose2d(2 * CHANNELS, CHANNELS, 1)
        self.fc1 = _squeeze()
        self.fc2 = _excite()

    def forward(self, maps: Tensor, other: Tensor) -> Tensor:
        """`maps` (n, 256, s, s) with what `other` (n, 256, s, s) adds."""
        weight = self.fc2(F.relu(self.fc1(other.mean((2, 3), keepdim=True)))).sigmoid()
        joined = F.relu(self.add(torch.cat([maps, other], dim=1)))
        strengthened: Tensor = maps + self.gamma1 * joined + self.gamma3 * weight * maps
        return strengthened


class ChannelAttention(nn.Module):
    """Weights channels by their largest and by their mean value."""

    def __init__(self) -> None:
        """Build with fresh weights; `conv1` is in the checkpoints and never used."""
        super().__init__()
        self.gamma2 = nn.Parameter(torch.zeros(1))
        self.conv1 = nn.Sequential(*conv_batch_norm(CHANNELS, CHANNELS, size=7, padding=3)[:2])
        self.fc1 = _squeeze()
        self.fc2 = _excite()

    def forward(self, maps: Tensor) -> Tensor:
        """(n, 256, s, s) to the same shape."""
        pooled = (maps.amax((2, 3), keepdim=True), maps.mean((2, 3), keepdim=True))
        largest, mean = (self.fc2(F.relu(self.fc1(one))) for one in pooled)
        weighted: Tensor = maps + self.gamma2 * (largest + mean).sigmoid() * maps
        return weighted


class PointAttention(nn.Module):
    """Self-attention between the cells of a map, without scaling of the products."""

    def __init__(self) -> None:
        """Build with fresh weights; the factor starts at zero."""
        super().__init__()
        self.gamma = nn.Parameter(torch.zeros(1))
        self.query_conv = nn.Conv2d(CHANNELS, _TOKEN_CHANNELS, 1)
        self.key_conv = nn.Conv2d(CHANNELS, _TOKEN_CHANNELS, 1)
        self.value_conv = nn.Conv2d(CHANNELS, CHANNELS, 1)

    def forward(self, maps: Tensor) -> Tensor:
        """(n, 256, s, s) to the same shape."""
        query, key = self.query_conv(maps).flatten(2), self.key_conv(maps).flatten(2)
        shares = (query.transpose(1, 2) @ key).softmax(dim=2)
        mixed = self.value_conv(maps).flatten(2) @ shares.transpose(1, 2)
        attended: Tensor = self.gamma * mixed.view(maps.shape) + maps
        return attended


class AttentiveProposal(ProposalHead):
    """Anchors from the correlations of stages 4 and 5."""

    def __init__(self) -> None:
        """Build with fresh weights."""
        super().__init__()
        self.conv_shape = Layers(*conv_batch_norm(CHANNELS, CHANNELS, padding=1))
        self.anchor = nn.Conv2d(CHANNELS, 4, 3, padding=1)
        self.conv3 = Layers(*conv_batch_norm(STAGE4_CHANNELS, CHANNELS, padding=1))
        self.conv5 = Layers(*conv_batch_norm(CHANNELS, CHANNELS, padding=1))
        self.conv6 = Layers(*conv_batch_norm(CHANNELS, CHANNELS, padding=1))
        self.adcat = CrossAggregation()

    def embed(self, fourth: Tensor, fifth: Tensor) -> Kernels:
        """The features of stage 4 as they are, (n, 384, 8, 8), and a kernel (n, 256, 6, 6)."""
        return fourth.contiguous(), self.conv6(fifth)

    def forward(self, kernels: Kernels, fourth: Tensor, fifth: Tensor) -> tuple[Tensor, Tensor]:
        """Both stages joined (n, 256, 21, 21), and the sides (n, 4, 21, 21)."""
        of_fourth, of_fifth = kernels
        earlier = self.conv3(depthwise_correlation(fourth, of_fourth))
        later = depthwise_correlation(self.conv5(fifth), of_fifth)
        joined = self.adcat(later, earlier)
        return joined, self.anchor(self.conv_shape(joined))


class AttentiveHeads(ScoreHeads):
    """Scores and boxes from the correlation of stage 5 after attention over cells and channels."""

    def __init__(self) -> None:
        """Build with fresh weights."""
        super().__init__()
        self.conv1 = Layers(*conv_batch_norm(CHANNELS, CHANNELS, padding=1))
        self.conv2 = Layers(*conv_batch_norm(CHANNELS, CHANNELS, padding=1))
        self.conv4 = Layers(*conv_batch_norm(CHANNELS, CHANNELS, padding=1))
        self.convloc = tower(CHANNELS, 4, 4)
        self.convcls = tower(CHANNELS, 2)
        self.channel = ChannelAttention()
        self.point = PointAttention()
        self.add_classifiers()
        self.adcat = CrossAggregation()

    def embed(self, fifth: Tensor) -> Kernels:
        """One kernel, (n, 256, 6, 6)."""
        return (self.conv2(fifth),)

    def forward(self, kernels: Kernels, fifth: Tensor, proposed: Tensor) -> Maps:
        """Maps of 21x21 cells; `proposed` is the proposal head's joined map."""
        [kernel] = kernels
        found = depthwise_correlation(self.conv1(fifth), kernel)
        found = self.conv4(self.channel(self.point(found)))
        return self.read(self.adcat(found, proposed))


class SiamAPNppNetwork(ProposalNetwork):
    """SiamAPN++; `state_dict()` has the official keys and shapes."""

    def __init__(self) -> None:
        """Build with fresh weights."""
        super().__init__(AttentiveProposal(), AttentiveHeads())
