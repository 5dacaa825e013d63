"""The transformer of SCT: one block over positions, one over channels.

Tokens are (N, L, C), L the pixels of a square grid in row-major order. Names of modules are those
of the official state dict.
"""

import math
from typing import Literal, cast

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from nat2024.networks.folding import Derived, fold_batch_norm, may_derive

Statistics = Literal["running", "image"]

_WINDOW = 4
_HEADS = 4


class Projection(nn.Module):
    """Queries, keys and values of all heads."""

    def __init__(self, dim: int) -> None:
        super().__init__()
        self.to_q = nn.Linear(dim, dim)
        self.to_kv = nn.Linear(dim, 2 * dim)

    def forward(self, x: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """(B, L, C) to three tensors (B, heads, L, C / heads)."""
        query = self.to_q(x).unflatten(-1, (_HEADS, -1)).transpose(1, 2)
        key, value = self.to_kv(x).unflatten(-1, (2, _HEADS, -1)).permute(2, 0, 3, 1, 4)
        return query, key, value


class WindowAttention(nn.Module):
    """Attention among the tokens of a 4x4 window, with a bias by their distance."""

    relative_position_index: Tensor

    def __init__(self, dim: int) -> None:
        super().__init__()
        self.scale = (dim // _HEADS) ** -0.5
        table = torch.empty((2 * _WINDOW - 1) ** 2, _HEADS)
        self.relative_position_bias_table = nn.Parameter(nn.init.trunc_normal_(table, std=0.02))
        self.register_buffer("relative_position_index", relative_positions(_WINDOW))
        self.qkv = Projection(dim)
        self.proj = nn.Linear(dim, dim)

    def forward(self, x: Tensor) -> Tensor:
        """(N * windows, 16, C) to the same."""
        query, key, value = self.qkv(x)
        bias = self.relative_position_bias_table[self.relative_position_index].permute(2, 0, 1)
        weights = ((query * self.scale) @ key.transpose(-2, -1) + bias).softmax(dim=-1)
        return self.proj((weights @ value).transpose(1, 2).flatten(2))  # type: ignore[no-any-return]


def relative_positions(window: int) -> Tensor:
    """int64 (L, L): which entry of the bias table belongs to each pair of a window's tokens."""
    place = torch.arange(window)
    rows, columns = place.repeat_interleave(window), place.repeat(window)
    down = rows[:, None] - rows + window - 1
    right = columns[:, None] - columns + window - 1
    return down * (2 * window - 1) + right


class NormedConvolution(nn.Module):
    """Convolution without bias, BatchNorm, GELU.

    At inference the BatchNorm is folded into the convolution, unless `statistics` is "image": then
    every image is normalised by its own mean and variance, as a network that was left in training
    mode does with a single image.
    """

    def __init__(self, dim: int, kernel: int, groups: int, statistics: Statistics) -> None:
        super().__init__()
        self.padding, self.groups = kernel // 2, groups
        convolution = nn.Conv2d(dim, dim, kernel, padding=self.padding, groups=groups, bias=False)
        self.conv = nn.Sequential(convolution, nn.BatchNorm2d(dim))
        self.statistics = statistics
        # A bound method, so that a deep copy of this module folds its own weights.
        self._folded = Derived(self, self._fold)

    def forward(self, x: Tensor) -> Tensor:
        """(N, dim, H, W) to the same."""
        if self.statistics == "image" and not self.training:
            return F.gelu(self._by_image(x))
        if may_derive(self):
            weight, bias = self._folded()
            return F.gelu(F.conv2d(x, weight, bias, padding=self.padding, groups=self.groups))
        return F.gelu(self.conv(x))

    def _fold(self) -> tuple[Tensor, Tensor]:
        return fold_batch_norm(*self._parts())

    def _by_image(self, x: Tensor) -> Tensor:
        layer, norm = self._parts()
        # Statistics of each image alone, which is what instance normalisation takes.
        return F.instance_norm(
            layer(x), weight=norm.weight, bias=norm.bias, use_input_stats=True, eps=norm.eps
        )

    def _parts(self) -> tuple[nn.Conv2d, nn.BatchNorm2d]:
        return cast("tuple[nn.Conv2d, nn.BatchNorm2d]", tuple(self.conv))


class Mlp(nn.Module):
    """Feed-forward layer with a residual convolution on the grid of the tokens."""

    def __init__(self, dim: int, statistics: Statistics) -> None:
        super().__init__()
        hidden = 4 * dim
        self.linear1 = nn.Sequential(nn.Linear(dim, hidden), nn.GELU())
        self.block = nn.Sequential(
            NormedConvolution(hidden, 1, 1, statistics),
            NormedConvolution(hidden, 3, hidden, statistics),
        )
        self.linear2 = nn.Sequential(nn.Linear(hidden, dim))

    def forward(self, x: Tensor) -> Tensor:
        """(N, L, C) to the same."""
        side = math.isqrt(x.shape[1])
        # Contiguous for the BatchNorms: their CPU statistics of channels-last data are inexact.
        grid = self.linear1(x).transpose(1, 2).unflatten(2, (side, side)).contiguous()
        grid = grid + self.block(grid)
        return self.linear2(grid.flatten(2).transpose(1, 2))  # type: ignore[no-any-return]


class Block(nn.Module):
    """Window attention, then the feed-forward layer; each is added to its input."""

    def __init__(self, dim: int, drop_path: float, statistics: Statistics) -> None:
        super().__init__()
        self.norm1 = nn.LayerNorm(dim)
        self.attn = WindowAttention(dim)
        self.norm2 = nn.LayerNorm(dim)
        self.mlp = Mlp(dim, statistics)
        self.drop_path = drop_path

    def forward(self, x: Tensor) -> Tensor:
        """(N, L, C) to the same."""
        side = math.isqrt(x.shape[1])
        attended = self.attn(to_windows(self.norm1(x), side))
        x = x + self._drop(from_windows(attended, side))
        return x + self._drop(self.mlp(self.norm2(x)))

    def _drop(self, x: Tensor) -> Tensor:
        """Leave a branch out for some images of a training batch (stochastic depth)."""
        if not (self.training and self.drop_path):
            return x
        kept = torch.rand(x.shape[0], 1, 1, device=x.device) >= self.drop_path
        return x * (kept / (1 - self.drop_path))


def to_windows(x: Tensor, side: int) -> Tensor:
    """Tokens (N, side * side, C) to those of each window, (N * windows, 16, C)."""
    count = side // _WINDOW
    grid = x.reshape(-1, count, _WINDOW, count, _WINDOW, x.shape[-1])
    return grid.transpose(2, 3).reshape(-1, _WINDOW**2, x.shape[-1])


def from_windows(windows: Tensor, side: int) -> Tensor:
    """The reverse of `to_windows`."""
    count = side // _WINDOW
    grid = windows.reshape(-1, count, count, _WINDOW, _WINDOW, windows.shape[-1])
    return grid.transpose(2, 3).reshape(-1, side**2, windows.shape[-1])


class EncoderLayer(nn.Module):
    """The one block of a layer, under the name that the official state dict has for it."""

    def __init__(self, dim: int, drop_path: float, statistics: Statistics) -> None:
        super().__init__()
        self.blocks = nn.ModuleList([Block(dim, drop_path, statistics)])

    def forward(self, x: Tensor) -> Tensor:
        """(N, L, C) to the same."""
        for block in self.blocks:
            x = block(x)
        return x
