"""The network of NanoTrack: MobileNetV3 features, correlation, towers.

Source: HonglinChu/SiamTrackers, `NanoTrack/` (Apache-2.0; there is no paper); key names and shapes
as in its checkpoints. Crops are float32 (n, 3, side, side), 0..255, BGR, without mean or scale.
"""

import copy

import torch
from torch import Tensor, nn

from nat2024.networks.folding import Derived, fold_batch_norm, may_derive
from nat2024_trackers.nanotrack.heads import HEADS, HeadV1, HeadV2, HeadV3, Kernels
from nat2024_trackers.nanotrack.mobilenet import BLOCKS, MobileNetV3, channels_of

Parts = tuple[MobileNetV3, HeadV1 | HeadV2 | HeadV3]
"""Backbone and head."""

_NECK_CHANNELS = {"v1": 64, "v2": 64, "v3": 96}


class UnusedNeck(nn.Module):
    """A layer that official checkpoints hold and the official code does not run."""

    def __init__(self, channels: int) -> None:
        """Build with fresh weights."""
        super().__init__()
        self.downsample = nn.Sequential(
            nn.Conv2d(channels, channels, 1, bias=False), nn.BatchNorm2d(channels)
        )

    def forward(self, features: Tensor) -> Tensor:
        """The features as they are."""
        return features


class NanoTrackNetwork(nn.Module):
    """The whole network; `state_dict()` has the official keys and shapes.

    In eval mode without gradients a copy with batch norms folded into convolutions runs, channels
    last. It is brought up to date at `embed`, since looking whether weights have changed takes
    long beside a network as small as this one; weights that are loaded between `embed` and `match`
    count from the next `embed`.
    """

    def __init__(self, variant: str) -> None:
        """Build version "v1", "v2" or "v3" with fresh weights."""
        super().__init__()
        channels = channels_of(variant)
        self.backbone = MobileNetV3(BLOCKS[variant])
        self.neck = UnusedNeck(_NECK_CHANNELS[variant])
        self.ban_head = HEADS[variant](channels)
        self._lean = Derived(self, self._fold)
        self._lean_parts: Parts | None = None

    def embed(self, template: Tensor) -> Kernels:
        """Head kernels of template crops (n, 3, 127, 127); constant through a sequence."""
        self._lean_parts = self._lean() if self._may_fold() else None
        backbone, head = self._parts()
        return head.embed(backbone(self._laid_out(template)))

    def match(self, kernels: Kernels, search: Tensor) -> tuple[Tensor, Tensor]:
        """(cls, loc): (n, 2, map, map) and (n, 4, map, map) of search crops (n, 3, 255, 255)."""
        backbone, head = self._parts()
        maps: tuple[Tensor, Tensor] = head(kernels, backbone(self._laid_out(search)))
        return maps

    def forward(self, template: Tensor, search: Tensor) -> tuple[Tensor, Tensor]:
        """Both sides at once, as training needs it."""
        return self.match(self.embed(template), search)

    def _parts(self) -> Parts:
        if not self._may_fold():
            return self.backbone, self.ban_head
        if self._lean_parts is None:
            self._lean_parts = self._lean()
        return self._lean_parts

    def _laid_out(self, crops: Tensor) -> Tensor:
        if not self._may_fold():
            return crops
        return crops.contiguous(memory_format=torch.channels_last)

    def _may_fold(self) -> bool:
        # Tensors without numbers (FakeTensorMode) cannot be copied; they are counted, not timed.
        return may_derive(self) and type(torch.empty(0)) is Tensor

    def _fold(self) -> Parts:
        # Ordinary tensors, whatever mode asks first: the copy may serve others later.
        with torch.inference_mode(mode=False), torch.no_grad():
            parts: Parts = copy.deepcopy((self.backbone, self.ban_head))
            for part in parts:
                _fold_sequences(part.requires_grad_(requires_grad=False))
                for weight in part.parameters():
                    if weight.dim() == 4:
                        weight.data = weight.data.contiguous(memory_format=torch.channels_last)
        return parts


def _fold_sequences(module: nn.Module) -> None:
    """Fold every batch norm into the convolution before it, in all `nn.Sequential` inside."""
    for part in module.modules():
        if isinstance(part, nn.Sequential):
            layers = _folded(list(part))
            del part[:]
            part.extend(layers)


def _folded(layers: list[nn.Module]) -> list[nn.Module]:
    found: list[nn.Module] = []
    for layer in layers:
        before = found[-1] if found else None
        if isinstance(layer, nn.BatchNorm2d) and isinstance(before, nn.Conv2d):
            weight, bias = fold_batch_norm(before, layer)
            before.weight = nn.Parameter(weight, requires_grad=False)
            before.bias = nn.Parameter(bias, requires_grad=False)
        elif not isinstance(layer, nn.Identity):
            found.append(layer)
    return found
