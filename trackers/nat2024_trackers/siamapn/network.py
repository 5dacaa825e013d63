"""What the networks of SiamAPN and SiamAPN++ share: a backbone, a proposal head, score heads.

Key names and shapes as in the checkpoints of vision4robotics/SiamAPN. Crops are float32
(n, 3, side, side), 0..255, BGR, without mean or scale.
"""

from typing import TypeAlias

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from nat2024.networks.folding import Derived, may_derive
from nat2024_trackers.siamese.alexnet import AlexNet
from nat2024_trackers.siamese.layers import Layers

CHANNELS = 256
STAGE4_CHANNELS = 384

Kernels: TypeAlias = tuple[Tensor, ...]
"""What depends on the template only; axis 0 counts the sequences."""

Maps: TypeAlias = tuple[Tensor, Tensor, Tensor, Tensor]
"""cls1 (n, 2, s, s), cls2 (n, 2, s, s), cls3 (n, 1, s, s), loc (n, 4, s, s)."""


class ProposalHead(nn.Module):
    """`grader`: proposes an anchor for each cell."""

    def embed(self, fourth: Tensor, fifth: Tensor) -> Kernels:
        """Kernels of the template's features of stages 4 and 5."""
        raise NotImplementedError

    def forward(self, kernels: Kernels, fourth: Tensor, fifth: Tensor) -> tuple[Tensor, Tensor]:
        """A map for the score heads, and the proposed sides (n, 4, s, s)."""
        raise NotImplementedError


class ScoreHeads(nn.Module):
    """`new`: three classifications and the refinement of the proposals.

    A subclass registers the layers, so that they have the official order.
    """

    convloc: Layers
    convcls: Layers
    cls1: nn.Conv2d
    cls2: nn.Conv2d
    cls3: nn.Conv2d

    def __init__(self) -> None:
        """Build without layers."""
        super().__init__()
        self._joined = Derived(self, self._join)

    def add_classifiers(self) -> None:
        """Register `cls1`, `cls2` and `cls3` with fresh weights."""
        self.cls1 = nn.Conv2d(CHANNELS, 2, 3, padding=1)
        self.cls2 = nn.Conv2d(CHANNELS, 2, 3, padding=1)
        self.cls3 = nn.Conv2d(CHANNELS, 1, 3, padding=1)

    def embed(self, fifth: Tensor) -> Kernels:
        """Kernels of the template's features of stage 5."""
        raise NotImplementedError

    def forward(self, kernels: Kernels, fifth: Tensor, proposed: Tensor) -> Maps:
        """Maps of the search features of stage 5; `proposed` is the proposal head's map."""
        raise NotImplementedError

    def read(self, joined: Tensor) -> Maps:
        """The last layers, of a map (n, 256, s, s)."""
        classes = self.convcls(joined)
        offsets = self.convloc(joined)
        if not may_derive(self):
            return self.cls1(classes), self.cls2(classes), self.cls3(classes), offsets
        weight, bias = self._joined()
        scores = F.conv2d(classes, weight, bias, padding=1)
        return scores[:, :2], scores[:, 2:4], scores[:, 4:], offsets

    def _join(self) -> tuple[Tensor, Tensor]:
        """The three classifiers as one convolution."""
        layers = (self.cls1, self.cls2, self.cls3)
        weight = torch.cat([layer.weight for layer in layers])
        biases = [layer.bias for layer in layers if layer.bias is not None]
        return weight.contiguous(memory_format=torch.channels_last), torch.cat(biases)


class ProposalNetwork(nn.Module):
    """The whole network; `state_dict()` has the official keys and shapes."""

    def __init__(self, grader: ProposalHead, heads: ScoreHeads) -> None:
        """Put the parts together, with fresh weights."""
        super().__init__()
        self.backbone = AlexNet()
        self.grader = grader
        self.new = heads

    def embed(self, template: Tensor) -> Kernels:
        """All that depends on template crops (n, 3, 127, 127); constant through a sequence."""
        _, fourth, fifth = self.backbone(template)
        return (*self.new.embed(fifth), *self.grader.embed(fourth, fifth))

    def match(self, kernels: Kernels, search: Tensor) -> tuple[Tensor, ...]:
        """cls1, cls2, cls3, loc and anchors, (n, channels, 21, 21) of search crops 287 wide."""
        _, fourth, fifth = self.backbone(search)
        kernel, *of_grader = kernels
        proposed, anchors = self.grader(tuple(of_grader), fourth, fifth)
        return (*self.new((kernel,), fifth, proposed), anchors)

    def forward(self, template: Tensor, search: Tensor) -> tuple[Tensor, ...]:
        """Both sides at once, as training needs it."""
        return self.match(self.embed(template), search)
