"""The network of LPAT: a transformer whose attention leans on a neighbourhood's elements.

Source: Fu et al., arXiv 2208.00662, and vision4robotics/LPAT.
"""

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from nat2024_trackers.hift.attention import Attention, to_maps, to_tokens
from nat2024_trackers.hift.layers import MergedConv
from nat2024_trackers.hift.network import CHANNELS, DistanceNetwork

_HEADS = 8
_HIDDEN = 768
_CODED = 512
_NARROW, _WIDE = 18, 24
_EPSILON = 1e-3
_NEAR = 2


def far_mask(height: int, width: int, device: torch.device | None = None) -> Tensor:
    """(cells, cells): 0 where the second cell lies in the 5x5 neighbourhood of the first, else 1.

    Official code differs from the paper: the mask is one of numbers, not of truth values, so it is
    added to the attention's logits and favours far cells a little instead of shutting them out.
    """
    rows = torch.arange(height, device=device)[:, None].expand(height, width).flatten()
    columns = torch.arange(width, device=device).expand(height, width).flatten()
    distance = torch.maximum(
        (rows[:, None] - rows[None]).abs(), (columns[:, None] - columns[None]).abs()
    )
    return (distance > _NEAR).float()


def _conv_norm(channels_in: int, channels_out: int, height: int = 1, width: int = 1) -> MergedConv:
    """Convolution that keeps the size, batch norm, ReLU; the kernel is `height` x `width`."""
    convolution = nn.Conv2d(
        channels_in,
        channels_out,
        (height, width),
        padding=(height // 2, width // 2),
        bias=False,
    )
    norm = nn.BatchNorm2d(channels_out, eps=_EPSILON)
    return MergedConv(convolution, norm, ("conv", "bn"))


class CorrectionNet(nn.Module):
    """Two narrow branches of different reach whose answer is added to the input."""

    def __init__(self, channels: int) -> None:
        """Build with fresh weights."""
        super().__init__()
        self.branch1 = _conv_norm(channels, _NARROW)
        self.branch2 = nn.Sequential(
            _conv_norm(channels, _WIDE),
            _conv_norm(_WIDE, _WIDE, width=3),
            _conv_norm(_WIDE, _WIDE, height=3),
        )
        self.conv_linear = nn.Conv2d(_NARROW + _WIDE, channels, 1, bias=False)

    def forward(self, maps: Tensor) -> Tensor:
        """(n, channels, s, s) to the same shape."""
        branches = torch.cat([self.branch1(maps), self.branch2(maps)], dim=1)
        return F.relu(self.conv_linear(branches) + maps)


class LocalElementCoder(nn.Module):
    """What two stages say about each cell and its neighbours."""

    def __init__(self) -> None:
        """Build with fresh weights."""
        super().__init__()
        self.cov_init = _conv_norm(2 * CHANNELS, _CODED)
        self.loc1 = CorrectionNet(_CODED)
        self.cov2 = _conv_norm(_CODED, CHANNELS)

    def forward(self, tokens: Tensor, other: Tensor, size: tuple[int, int]) -> Tensor:
        """Tokens (n, length, 192) of both to tokens; `size` is (rows, columns)."""
        maps = to_maps(torch.cat([tokens, other], dim=2), size)
        return to_tokens(self.cov2(self.loc1(self.cov_init(maps))))


class EncoderLayer(nn.Module):
    """Attention from one stage to another, feed-forward, local elements."""

    def __init__(self) -> None:
        """Build with fresh weights; `norm0` is in the checkpoints and never used."""
        super().__init__()
        self.self_attn = Attention(CHANNELS, _HEADS)
        self.k_emb = _depthwise()
        self.q_emb = _depthwise()
        self.linear1 = nn.Linear(CHANNELS, _HIDDEN)
        self.linear2 = nn.Linear(_HIDDEN, CHANNELS)
        self.norm0 = nn.LayerNorm(CHANNELS)
        self.norm1 = nn.LayerNorm(CHANNELS)
        self.norm2 = nn.LayerNorm(CHANNELS)
        self.norm3 = nn.LayerNorm(CHANNELS)
        self.loc = LocalElementCoder()

    def forward(self, maps: Tensor, other: Tensor, code: Tensor, mask: Tensor) -> Tensor:
        """Maps (n, 192, s, s) of the asking and of the answering stage to tokens."""
        size = (maps.shape[2], maps.shape[3])
        query = to_tokens(self.q_emb(maps + code))
        key = to_tokens(self.k_emb(other + code))
        tokens, values = to_tokens(maps), to_tokens(other)
        x = self.norm1(tokens + self.self_attn(query, key, values, mask))
        x = self.norm2(x + self.linear2(F.relu(self.linear1(x))))
        encoded: Tensor = self.norm3(x + self.loc(tokens, values, size))
        return encoded


def _depthwise() -> nn.Conv2d:
    return nn.Conv2d(CHANNELS, CHANNELS, 3, padding=1, groups=CHANNELS, bias=False)


class Encoder(nn.Module):
    """One layer and a last norm, which is given."""

    def __init__(self, norm: nn.LayerNorm) -> None:
        """Build with fresh weights around `norm`."""
        super().__init__()
        self.layers = nn.ModuleList([EncoderLayer()])
        self.norm = norm

    def forward(self, maps: Tensor, other: Tensor, code: Tensor, mask: Tensor) -> Tensor:
        """Maps (n, 192, s, s) of two stages to one map."""
        size = (maps.shape[2], maps.shape[3])
        for layer in self.layers:
            maps = to_maps(layer(maps, other, code, mask), size)
        return to_maps(self.norm(to_tokens(maps)), size)


class DecoderLayer(nn.Module):
    """Attention within a stage, local elements, attention to the encoder, feed-forward."""

    def __init__(self) -> None:
        """Build with fresh weights."""
        super().__init__()
        self.self_attn = Attention(CHANNELS, _HEADS)
        self.multihead_attn = Attention(CHANNELS, _HEADS)
        self.linear1 = nn.Linear(CHANNELS, _HIDDEN)
        self.linear2 = nn.Linear(_HIDDEN, CHANNELS)
        self.loc = LocalElementCoder()
        self.norm1 = nn.LayerNorm(CHANNELS)
        self.norm2 = nn.LayerNorm(CHANNELS)
        self.norm3 = nn.LayerNorm(CHANNELS)
        self.norm4 = nn.LayerNorm(CHANNELS)

    def forward(
        self, tokens: Tensor, memory: Tensor, code: Tensor, size: tuple[int, int]
    ) -> Tensor:
        """Tokens (n, length, 192) of a stage, of the encoder, of the position code."""
        placed = tokens + code
        x = self.norm1(tokens + self.self_attn(placed, placed, tokens))
        local = self.loc(x, memory, size)
        x = self.norm2(x + self.multihead_attn(x + code, memory + code, memory))
        x = self.norm3(x + self.linear2(F.relu(self.linear1(x))))
        decoded: Tensor = self.norm4(x + local)
        return decoded


class Decoder(nn.Module):
    """One layer and a last norm."""

    def __init__(self) -> None:
        """Build with fresh weights."""
        super().__init__()
        self.layers = nn.ModuleList([DecoderLayer()])
        self.norm = nn.LayerNorm(CHANNELS)

    def forward(
        self, tokens: Tensor, memory: Tensor, code: Tensor, size: tuple[int, int]
    ) -> Tensor:
        """See `DecoderLayer`."""
        for layer in self.layers:
            tokens = layer(tokens, memory, code, size)
        normed: Tensor = self.norm(tokens)
        return normed


class LocalPerceptionTransformer(nn.Module):
    """Encodes stage 4 with stage 3, stage 5 with both, and decodes stage 5 with that.

    Official code differs from the paper: both encoders end in one and the same norm, which
    checkpoints list twice; where the two differ, the second one's values count.
    """

    def __init__(self) -> None:
        """Build with fresh weights."""
        super().__init__()
        norm = nn.LayerNorm(CHANNELS)
        # In this order, since the values of encoder2.norm are to be loaded last.
        self.encoder1 = Encoder(norm)
        self.encoder2 = Encoder(norm)
        self.decoder = Decoder()
        self.preset = CorrectionNet(CHANNELS)

    def forward(self, code: Tensor, third: Tensor, fourth: Tensor, fifth: Tensor) -> Tensor:
        """Position code and maps of the stages, (n, 192, s, s), to one map of that shape."""
        size = (third.shape[2], third.shape[3])
        mask = far_mask(*size, third.device).to(third)
        encoded = self.encoder1(fourth, third, code, mask)
        memory = to_tokens(self.encoder2(fifth, encoded, code, mask))
        tokens = to_tokens(fifth + self.preset(fifth))
        return to_maps(self.decoder(tokens, memory, to_tokens(code), size), size)


class LPATNetwork(DistanceNetwork):
    """The whole network; `state_dict()` has the official keys and shapes."""

    def __init__(self) -> None:
        """Build with fresh weights."""
        super().__init__(LocalPerceptionTransformer())
