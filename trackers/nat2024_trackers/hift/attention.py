"""Attention over the 121 cells of a map, with the keys of `torch.nn.MultiheadAttention`."""

import itertools

import torch
import torch.nn.functional as F
from torch import Tensor, nn


class Attention(nn.Module):
    """Multi-head attention over tokens (n, length, channels), without dropout.

    The same numbers as `torch.nn.MultiheadAttention`, with one matrix product for each input that
    differs; the attention weights are never kept.
    """

    def __init__(self, channels: int, heads: int) -> None:
        """Build with fresh weights."""
        super().__init__()
        self.heads = heads
        self.in_proj_weight = nn.Parameter(torch.empty(3 * channels, channels))
        self.in_proj_bias = nn.Parameter(torch.zeros(3 * channels))
        self.out_proj = nn.Linear(channels, channels)
        nn.init.xavier_uniform_(self.in_proj_weight)
        nn.init.zeros_(self.out_proj.bias)

    def forward(
        self, query: Tensor, key: Tensor, value: Tensor, mask: Tensor | None = None
    ) -> Tensor:
        """Attend from `query` to `key`; (n, length, channels) each.

        Args:
            query: what asks.
            key: what is compared with it.
            value: what is mixed; it may be the same tensor as `key`, as `key` may be as `query`.
            mask: (length of query, length of key), added to the logits of every head.
        """
        queries, keys, values = self._project(query, key, value)
        mixed = F.scaled_dot_product_attention(queries, keys, values, attn_mask=mask)
        answer: Tensor = self.out_proj(mixed.transpose(1, 2).flatten(2))
        return answer

    def _project(self, query: Tensor, key: Tensor, value: Tensor) -> tuple[Tensor, ...]:
        """Queries, keys and values, (n, heads, length, channels of a head) each."""
        channels = query.shape[2]
        found: list[Tensor] = []
        for _, run in itertools.groupby((query, key, value), key=id):
            same = list(run)
            rows = slice(len(found) * channels, (len(found) + len(same)) * channels)
            projected = F.linear(same[0], self.in_proj_weight[rows], self.in_proj_bias[rows])
            found.extend(projected.chunk(len(same), dim=2))
        return tuple(one.reshape(*one.shape[:2], self.heads, -1).transpose(1, 2) for one in found)


def to_tokens(maps: Tensor) -> Tensor:
    """Cells of maps (n, c, h, w) as tokens (n, h * w, c), row by row."""
    return maps.flatten(2).transpose(1, 2)


def to_maps(tokens: Tensor, size: tuple[int, int]) -> Tensor:
    """Maps (n, c, h, w) of tokens (n, h * w, c); `size` is (h, w)."""
    return tokens.transpose(1, 2).reshape(len(tokens), -1, *size)
