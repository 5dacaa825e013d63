"""What the networks of HiFT and LPAT share: all but the transformer between maps and heads.

Template features of the last three stages are correlated with the search features, each
correlation is halved in size, a transformer joins the three maps, and two heads read boxes and
classes from its answer. Key names and shapes as in the checkpoints of vision4robotics/HiFT and
vision4robotics/LPAT. Crops are float32 (n, 3, side, side), 0..255, BGR, without mean or scale.
"""

from typing import TypeAlias

import torch
from torch import Tensor, nn

from nat2024_trackers.hift.layers import halving_conv, head
from nat2024_trackers.siamese.alexnet import AlexNet
from nat2024_trackers.siamese.correlation import depthwise_correlation

CHANNELS = 192

Levels: TypeAlias = tuple[Tensor, Tensor, Tensor]
"""Maps of stages 3, 4 and 5 of the backbone."""

_LARGEST_MAP = 50


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
        self.conv1 = halving_conv(384, CHANNELS)
        self.conv3 = halving_conv(384, CHANNELS)
        self.conv2 = halving_conv(256, CHANNELS)
        self.convloc = head(CHANNELS, 4)
        self.convcls = head(CHANNELS)
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
        joined = self.transformer(code, first, self.conv3(fourth), self.conv2(fifth)).contiguous()
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
