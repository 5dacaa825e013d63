"""LPAT (Fu et al., arXiv 2208.00662) with its layers written plainly, as a yardstick for speed.

What the official code computes; all but the transformer is as in HiFT. One sequence at a time.
"""

import torch
import torch.nn.functional as F
from peers.hift import WIDTH, Peer, tokens
from torch import Tensor, nn


def mask_of(side: int) -> Tensor:
    """Numbers that are added to the attention's logits: 0 near a cell, 1 elsewhere."""
    mask = torch.ones(side, side, side, side)
    for row in range(side):
        for column in range(side):
            rows = slice(max(row - 2, 0), row + 3)
            mask[row, column, rows, max(column - 2, 0) : column + 3] = 0
    return mask.view(side * side, side * side)


class Convolution(nn.Module):
    """Convolution, batch norm, ReLU."""

    def __init__(self, before: int, after: int, size: tuple[int, int] = (1, 1)) -> None:
        super().__init__()
        padding = (size[0] // 2, size[1] // 2)
        self.conv = nn.Conv2d(before, after, size, padding=padding, bias=False)
        self.bn = nn.BatchNorm2d(after, eps=1e-3)

    def forward(self, maps: Tensor) -> Tensor:
        """One map to another."""
        return F.relu(self.bn(self.conv(maps)))


class Correction(nn.Module):
    """Two branches and the input."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.branch1 = Convolution(width, 18)
        wide = [Convolution(width, 24), Convolution(24, 24, (1, 3)), Convolution(24, 24, (3, 1))]
        self.branch2 = nn.Sequential(*wide)
        self.conv_linear = nn.Conv2d(42, width, 1, bias=False)

    def forward(self, maps: Tensor) -> Tensor:
        """One map to another."""
        both = torch.cat((self.branch1(maps), self.branch2(maps)), dim=1)
        return F.relu(self.conv_linear(both) + maps)


class LocalCoder(nn.Module):
    """Local element coder."""

    def __init__(self) -> None:
        super().__init__()
        self.cov_init = Convolution(2 * WIDTH, 512)
        self.loc1 = Correction(512)
        self.cov2 = Convolution(512, WIDTH)

    def forward(self, one: Tensor, other: Tensor) -> Tensor:
        """Tokens to tokens."""
        maps = as_maps(torch.cat((one, other), dim=2))
        return tokens(self.cov2(self.loc1(self.cov_init(maps))))


def as_maps(found: Tensor) -> Tensor:
    """(h * w, 1, c) to (1, c, h, w)."""
    side = int(len(found) ** 0.5)
    return found.permute(1, 2, 0).view(1, -1, side, side)


class EncoderLayer(nn.Module):
    """One layer."""

    def __init__(self) -> None:
        super().__init__()
        self.self_attn = nn.MultiheadAttention(WIDTH, 8)
        self.k_emb = nn.Conv2d(WIDTH, WIDTH, 3, padding=1, groups=WIDTH, bias=False)
        self.q_emb = nn.Conv2d(WIDTH, WIDTH, 3, padding=1, groups=WIDTH, bias=False)
        self.linear1, self.linear2 = nn.Linear(WIDTH, 768), nn.Linear(768, WIDTH)
        self.norm0, self.norm1 = nn.LayerNorm(WIDTH), nn.LayerNorm(WIDTH)
        self.norm2, self.norm3 = nn.LayerNorm(WIDTH), nn.LayerNorm(WIDTH)
        self.loc = LocalCoder()

    def forward(self, src: Tensor, other: Tensor, code: Tensor, mask: Tensor) -> Tensor:
        """Tokens of two stages to tokens."""
        query = tokens(self.q_emb(as_maps(src + code)))
        key = tokens(self.k_emb(as_maps(other + code)))
        x = self.norm1(src + self.self_attn(query, key, other, attn_mask=mask)[0])
        x = self.norm2(x + self.linear2(F.relu(self.linear1(x))))
        return self.norm3(x + self.loc(src, other))


class Encoder(nn.Module):
    """One layer and a norm that both encoders share."""

    def __init__(self, norm: nn.LayerNorm) -> None:
        super().__init__()
        self.layers = nn.ModuleList([EncoderLayer()])
        self.norm = norm

    def forward(self, src: Tensor, other: Tensor, code: Tensor, mask: Tensor) -> Tensor:
        """Tokens to tokens."""
        return self.norm(self.layers[0](src, other, code, mask))


class DecoderLayer(nn.Module):
    """One layer."""

    def __init__(self) -> None:
        super().__init__()
        self.self_attn = nn.MultiheadAttention(WIDTH, 8)
        self.multihead_attn = nn.MultiheadAttention(WIDTH, 8)
        self.linear1, self.linear2 = nn.Linear(WIDTH, 768), nn.Linear(768, WIDTH)
        self.loc = LocalCoder()
        self.norm1, self.norm2 = nn.LayerNorm(WIDTH), nn.LayerNorm(WIDTH)
        self.norm3, self.norm4 = nn.LayerNorm(WIDTH), nn.LayerNorm(WIDTH)

    def forward(self, tgt: Tensor, memory: Tensor, code: Tensor) -> Tensor:
        """Tokens to tokens."""
        x = self.norm1(tgt + self.self_attn(tgt + code, tgt + code, tgt)[0])
        local = self.loc(x, memory)
        x = self.norm2(x + self.multihead_attn(x + code, memory + code, memory)[0])
        x = self.norm3(x + self.linear2(F.relu(self.linear1(x))))
        return self.norm4(x + local)


class Decoder(nn.Module):
    """One layer and a last norm."""

    def __init__(self) -> None:
        super().__init__()
        self.layers = nn.ModuleList([DecoderLayer()])
        self.norm = nn.LayerNorm(WIDTH)

    def forward(self, tgt: Tensor, memory: Tensor, code: Tensor) -> Tensor:
        """Tokens to tokens."""
        return self.norm(self.layers[0](tgt, memory, code))


class Transformer(nn.Module):
    """Two encoders and a decoder."""

    def __init__(self) -> None:
        super().__init__()
        norm = nn.LayerNorm(WIDTH)
        self.encoder1, self.encoder2 = Encoder(norm), Encoder(norm)
        self.decoder = Decoder()
        self.preset = Correction(WIDTH)
        self.register_buffer("mask", mask_of(11), persistent=False)

    def forward(self, code: Tensor, first: Tensor, second: Tensor, third: Tensor) -> Tensor:
        """Maps to tokens."""
        place = tokens(code)
        memory = self.encoder1(tokens(second), tokens(first), place, self.mask)
        memory = self.encoder2(tokens(third), memory, place, self.mask)
        return self.decoder(tokens(third + self.preset(third)), memory, place)


def build() -> nn.Module:
    """The network in eval mode, with the official checkpoint's keys."""
    return Peer(Transformer()).eval()
