"""The network of HiFT: a transformer that joins the maps of three stages.

Source: Cao et al., ICCV 2021, and vision4robotics/HiFT.
"""

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from nat2024_trackers.hift.attention import Attention, to_maps, to_tokens
from nat2024_trackers.hift.network import CHANNELS, DistanceNetwork

_HEADS = 6
_HIDDEN = 2048
_DECODER_LAYERS = 2
_SQUEEZED = 32


class Modulation(nn.Module):
    """Channel attention that lets one stage weigh the channels of another.

    Official code differs from the paper: both inputs are tokens whose memory is read as if it were
    maps, without the transpose that this needs, and the answer is transposed all the same. The
    tokens leave it scrambled. Trained weights depend on that, so it is done here too, sample by
    sample (the official code would mix the samples of a batch).
    """

    def __init__(self) -> None:
        """Build with fresh weights; `gamma` starts at zero."""
        super().__init__()
        self.conv1 = nn.Sequential(nn.ConvTranspose2d(2 * CHANNELS, CHANNELS, 1))
        self.linear1 = nn.Conv2d(CHANNELS, _SQUEEZED, 1, bias=False)
        self.linear2 = nn.Conv2d(_SQUEEZED, CHANNELS, 1, bias=False)
        self.gamma = nn.Parameter(torch.zeros(1))

    def forward(self, tokens: Tensor, other: Tensor, size: tuple[int, int]) -> Tensor:
        """Modulate `tokens` by `other`, (n, length, 192) each; `size` is (rows, columns)."""
        shape = (len(tokens), CHANNELS, *size)
        x = tokens.contiguous().view(shape)
        y = other.contiguous().view(shape)
        weight = self.linear2(F.relu(self.linear1(y.mean((2, 3), keepdim=True))))
        change = self.conv1(torch.cat([x, y], dim=1)) * weight
        return to_tokens(x + self.gamma * change * x)


class EncoderLayer(nn.Module):
    """Attention within stage 3 led by stages 3 and 4, modulation by stage 4, feed-forward."""

    def __init__(self) -> None:
        """Build with fresh weights; `eles` is in the checkpoints and never used."""
        super().__init__()
        self.self_attn = Attention(CHANNELS, _HEADS)
        self.cross_attn = Modulation()
        self.eles = nn.Sequential(
            nn.Conv2d(CHANNELS, CHANNELS, 3, padding=1), nn.GroupNorm(_SQUEEZED, CHANNELS)
        )
        self.linear1 = nn.Linear(CHANNELS, _HIDDEN)
        self.linear2 = nn.Linear(_HIDDEN, CHANNELS)
        self.norm0 = nn.LayerNorm(CHANNELS)
        self.norm1 = nn.LayerNorm(CHANNELS)
        self.norm2 = nn.LayerNorm(CHANNELS)

    def forward(self, tokens: Tensor, other: Tensor, size: tuple[int, int]) -> Tensor:
        """Tokens (n, length, 192) of stage 3 and of stage 4, both with position code."""
        both = self.norm0(tokens + other)
        x = self.norm1(tokens + self.self_attn(both, both, tokens))
        x = self.cross_attn(x, other, size)
        encoded: Tensor = self.norm2(x + self.linear2(F.relu(self.linear1(x))))
        return encoded


class DecoderLayer(nn.Module):
    """Attention within stage 5, attention to the encoder's answer, feed-forward."""

    def __init__(self) -> None:
        """Build with fresh weights."""
        super().__init__()
        self.self_attn = Attention(CHANNELS, _HEADS)
        self.multihead_attn = Attention(CHANNELS, _HEADS)
        self.linear1 = nn.Linear(CHANNELS, _HIDDEN)
        self.linear2 = nn.Linear(_HIDDEN, CHANNELS)
        self.norm1 = nn.LayerNorm(CHANNELS)
        self.norm2 = nn.LayerNorm(CHANNELS)
        self.norm3 = nn.LayerNorm(CHANNELS)

    def forward(self, tokens: Tensor, memory: Tensor) -> Tensor:
        """Tokens (n, length, 192) of stage 5 and of the encoder."""
        x = self.norm1(tokens + self.self_attn(tokens, tokens, tokens))
        x = self.norm2(x + self.multihead_attn(x, memory, memory))
        decoded: Tensor = self.norm3(x + self.linear2(F.relu(self.linear1(x))))
        return decoded


class Encoder(nn.Module):
    """One layer and a last norm."""

    def __init__(self) -> None:
        """Build with fresh weights."""
        super().__init__()
        self.layers = nn.ModuleList([EncoderLayer()])
        self.norm = nn.LayerNorm(CHANNELS)

    def forward(self, tokens: Tensor, other: Tensor, size: tuple[int, int]) -> Tensor:
        """See `EncoderLayer`."""
        for layer in self.layers:
            tokens = layer(tokens, other, size)
        normed: Tensor = self.norm(tokens)
        return normed


class Decoder(nn.Module):
    """Two layers and a last norm."""

    def __init__(self) -> None:
        """Build with fresh weights."""
        super().__init__()
        self.layers = nn.ModuleList([DecoderLayer() for _ in range(_DECODER_LAYERS)])
        self.norm = nn.LayerNorm(CHANNELS)

    def forward(self, tokens: Tensor, memory: Tensor) -> Tensor:
        """See `DecoderLayer`."""
        for layer in self.layers:
            tokens = layer(tokens, memory)
        normed: Tensor = self.norm(tokens)
        return normed


class HierarchicalTransformer(nn.Module):
    """Encodes stages 3 and 4, and decodes stage 5 with what they say."""

    def __init__(self) -> None:
        """Build with fresh weights."""
        super().__init__()
        self.encoder = Encoder()
        self.decoder = Decoder()

    def forward(self, code: Tensor, third: Tensor, fourth: Tensor, fifth: Tensor) -> Tensor:
        """Position code and maps of the stages, (n, 192, s, s), to one map of that shape."""
        size = (third.shape[2], third.shape[3])
        memory = self.encoder(to_tokens(third + code), to_tokens(fourth + code), size)
        return to_maps(self.decoder(to_tokens(fifth), memory), size)


class HiFTNetwork(DistanceNetwork):
    """The whole network; `state_dict()` has the official keys and shapes."""

    def __init__(self) -> None:
        """Build with fresh weights."""
        super().__init__(HierarchicalTransformer())
