"""The network of SiamAPN.

Source: Fu et al., ICRA 2021, section III, and `SiamAPN/` of vision4robotics/SiamAPN.
"""

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from nat2024.networks.convolving import Convolution
from nat2024.networks.folding import Derived, may_derive
from nat2024.networks.plain_form import is_plain
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
from nat2024_trackers.siamese.layers import Layers, conv_batch_norm, conv_group_norm, tower


class AnchorProposal(ProposalHead):
    """Anchors from the correlation of stage 4."""

    def __init__(self) -> None:
        """Build with fresh weights."""
        super().__init__()
        channels = STAGE4_CHANNELS
        self.conv_shape = Layers(
            *conv_batch_norm(channels, channels, padding=1), nn.Conv2d(channels, 4, 3, padding=1)
        )
        self.conv1 = Layers(*conv_batch_norm(channels, channels))
        self.conv2 = Layers(*conv_batch_norm(channels, channels))

    def embed(self, fourth: Tensor, fifth: Tensor) -> Kernels:  # noqa: ARG002
        """One kernel, (n, 384, 6, 6)."""
        return (self.conv2(fourth),)

    def forward(
        self,
        kernels: Kernels,
        fourth: Tensor,
        fifth: Tensor,  # noqa: ARG002
    ) -> tuple[Tensor, Tensor]:
        """The correlation (n, 384, 21, 21) and the sides (n, 4, 21, 21)."""
        [kernel] = kernels
        correlation = depthwise_correlation(self.conv1(fourth), kernel)
        return correlation, self.conv_shape(correlation)


class FusedHeads(ScoreHeads):
    """Scores and boxes from the correlation of stage 5 joined with that of stage 4."""

    def __init__(self) -> None:
        """Build with fresh weights."""
        super().__init__()
        self.conv1 = Layers(*conv_batch_norm(CHANNELS, CHANNELS))
        self.conv2 = Layers(*conv_batch_norm(CHANNELS, CHANNELS))
        self.convloc = tower(CHANNELS, 2, 4)
        self.convcls = tower(CHANNELS, 2)
        self.conv_offset = _shrinking(STAGE4_CHANNELS)
        self.add = nn.ConvTranspose2d(2 * CHANNELS, CHANNELS, 3)
        self.resize = _shrinking(CHANNELS)
        self.add_classifiers()
        self._add = Derived(self.add, self._as_convolution)

    def embed(self, fifth: Tensor) -> Kernels:
        """One kernel, (n, 256, 4, 4)."""
        return (self.conv2(fifth),)

    def forward(self, kernels: Kernels, fifth: Tensor, proposed: Tensor) -> Maps:
        """Maps of 21x21 cells; `proposed` is the correlation of stage 4."""
        [kernel] = kernels
        resized = self.resize(depthwise_correlation(self.conv1(fifth), kernel))
        both = torch.cat([resized, self.conv_offset(proposed)], dim=1)
        add = self._add() if may_derive(self) and not is_plain() else self.add
        return self.read(add(F.relu(both)))

    def _as_convolution(self) -> Convolution:
        """`add` as what it is at stride 1: a convolution with the kernel turned around."""
        weight = self.add.weight.transpose(0, 1).flip(2, 3)
        return Convolution(weight, self.add.bias, padding=weight.shape[-1] - 1)


def _shrinking(channels: int) -> Layers:
    """A padded convolution to 256 channels, and one without padding: 21 cells become 19."""
    return Layers(*conv_group_norm(channels, CHANNELS), nn.Conv2d(CHANNELS, CHANNELS, 3))


class SiamAPNNetwork(ProposalNetwork):
    """SiamAPN; `state_dict()` has the official keys and shapes."""

    def __init__(self) -> None:
        """Build with fresh weights."""
        super().__init__(AnchorProposal(), FusedHeads())
