"""What the networks of HiFT and LPAT share: all but the transformer between maps and heads.

Template features of the last three stages are correlated with the search features, each
correlation is halved in size, a transformer joins the three maps, and two heads read boxes and
classes from its answer. Key names and shapes as in the checkpoints of vision4robotics/HiFT and
vision4robotics/LPAT. Crops are float32 (n, 3, side, side), 0..255, BGR, without mean or scale.
"""

from typing import TypeAlias

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from nat2024.networks.folding import Derived, fold_batch_norm, may_derive
from nat2024_trackers.siamese.alexnet import AlexNet
from nat2024_trackers.siamese.correlation import depthwise_correlation

CHANNELS = 192

Levels: TypeAlias = tuple[Tensor, Tensor, Tensor]
"""Maps of stages 3, 4 and 5 of the backbone."""

_GROUPS = 32
_LARGEST_MAP = 50


class HalvingConv(nn.Sequential):
    """3x3 convolution with stride 2, batch norm, ReLU; one convolution at inference."""

    def __init__(self, channels_in: int, channels_out: int) -> None:
        """Build with fresh weights."""
        super().__init__(
            nn.Conv2d(channels_in, channels_out, 3, stride=2, padding=1, bias=False),
            nn.BatchNorm2d(channels_out),
            nn.ReLU(inplace=True),
        )
        self._folded = Derived(self, self._fold)

    def forward(self, maps: Tensor) -> Tensor:
        """(n, channels_in, s, s) to (n, channels_out, (s + 1) // 2, (s + 1) // 2)."""
        if not may_derive(self):
            halved: Tensor = super().forward(maps)
            return halved
        weight, bias = self._folded()
        return F.conv2d(maps, weight, bias, stride=2, padding=1).relu_()

    def _fold(self) -> tuple[Tensor, Tensor]:
        convolution, norm, _ = self.children()
        assert isinstance(convolution, nn.Conv2d)
        assert isinstance(norm, nn.BatchNorm2d)
        return fold_batch_norm(convolution, norm)


def _head(*channels_out: int) -> nn.Sequential:
    """Three convolutions, each with group norm and ReLU, and a last one where one is wanted."""
    layers: list[nn.Module] = []
    for _ in range(3):
        layers += [
            nn.Conv2d(CHANNELS, CHANNELS, 3, padding=1),
            nn.GroupNorm(_GROUPS, CHANNELS),
            nn.ReLU(inplace=True),
        ]
    layers += [nn.Conv2d(CHANNELS, channels, 3, padding=1) for channels in channels_out]
    return nn.Sequential(*layers)


class Grader(nn.Module):
    """From features of template and search crops to response maps.

    The names are the official ones: `conv3` belongs to stage 4 and `conv2` to stage 5.
    """

    def __init__(self, transformer: nn.Module) -> None:
        """Build with fresh weights around a transformer.

        Args:
            transformer: called with the position code, (1, 192, s, s), and the maps of stages 3, 4
                and 5, (n, 192, s, s) each; it answers with one map of that shape.
        """
        super().__init__()
        self.conv1 = HalvingConv(384, CHANNELS)
        self.conv3 = HalvingConv(384, CHANNELS)
        self.conv2 = HalvingConv(256, CHANNELS)
        self.convloc = _head(4)
        self.convcls = _head()
        self.row_embed = nn.Embedding(_LARGEST_MAP, CHANNELS // 2)
        self.col_embed = nn.Embedding(_LARGEST_MAP, CHANNELS // 2)
        for embedding in (self.row_embed, self.col_embed):
            nn.init.uniform_(embedding.weight)
        self.transformer = transformer
        self.cls1 = nn.Conv2d(CHANNELS, 2, 3, padding=1)
        self.cls2 = nn.Conv2d(CHANNELS, 1, 3, padding=1)

    def position_code(self, height: int, width: int) -> Tensor:
        """(1, 192, height, width): 96 channels that tell the column, then 96 for the row."""
        columns = self.col_embed.weight[:width].t()[:, None, :].expand(-1, height, -1)
        rows = self.row_embed.weight[:height].t()[:, :, None].expand(-1, -1, width)
        return torch.cat([columns, rows])[None]

    def forward(self, template: Levels, search: Levels) -> Levels:
        """Maps of two classes (n, 2, s, s), of a logit (n, 1, s, s), of distances (n, 4, s, s)."""
        third, fourth, fifth = (
            depthwise_correlation(features, kernel)
            for features, kernel in zip(search, template, strict=True)
        )
        first = self.conv1(third)
        code = self.position_code(*first.shape[2:])
        joined = self.transformer(code, first, self.conv3(fourth), self.conv2(fifth))
        classes = self.convcls(joined)
        return self.cls1(classes), self.cls2(classes), self.convloc(joined)


class DistanceNetwork(nn.Module):
    """Backbone and grader; a subclass brings its transformer.

    The template side that is kept are the backbone's features: the correlation uses them as they
    are, nothing else depends on the template alone.
    """

    def __init__(self, transformer: nn.Module) -> None:
        """Build with fresh weights."""
        super().__init__()
        self.backbone = AlexNet()
        self.grader = Grader(transformer)

    def embed(self, template: Tensor) -> Levels:
        """Features of template crops (n, 3, 127, 127); constant through a sequence."""
        features: Levels = self.backbone(template)
        return features

    def match(self, features: Levels, search: Tensor) -> Levels:
        """Maps (n, 2, 11, 11), (n, 1, 11, 11), (n, 4, 11, 11) of search crops (n, 3, 287, 287)."""
        maps: Levels = self.grader(features, self.backbone(search))
        return maps

    def forward(self, template: Tensor, search: Tensor) -> Levels:
        """Both sides at once, as training needs it."""
        return self.match(self.embed(template), search)
