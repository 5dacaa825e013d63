"""HiFT (Cao et al., ICCV 2021) with its layers written plainly, as a yardstick for speed.

What the official code computes: a batch norm after each convolution, PyTorch's attention over
tokens (cells, 1, channels), default memory layout. One sequence at a time.
"""

import torch
import torch.nn.functional as F
from torch import Tensor, nn

WIDTH = 192


class Backbone(nn.Module):
    """AlexNet without padding; maps of stages 3, 4 and 5."""

    def __init__(self) -> None:
        super().__init__()
        pool, relu = nn.MaxPool2d(3, stride=2), nn.ReLU(inplace=True)
        self.layer1 = nn.Sequential(nn.Conv2d(3, 96, 11, stride=2), nn.BatchNorm2d(96), pool, relu)
        self.layer2 = nn.Sequential(nn.Conv2d(96, 256, 5), nn.BatchNorm2d(256), pool, relu)
        self.layer3 = nn.Sequential(nn.Conv2d(256, 384, 3), nn.BatchNorm2d(384), relu)
        self.layer4 = nn.Sequential(nn.Conv2d(384, 384, 3), nn.BatchNorm2d(384), relu)
        self.layer5 = nn.Sequential(nn.Conv2d(384, 256, 3), nn.BatchNorm2d(256))

    def forward(self, crop: Tensor) -> list[Tensor]:
        """Maps of a crop (1, 3, S, S)."""
        third = self.layer3(self.layer2(self.layer1(crop)))
        fourth = self.layer4(third)
        return [third, fourth, self.layer5(fourth)]


def correlate(search: Tensor, kernel: Tensor) -> Tensor:
    """Depthwise correlation of (1, c, h, w) with (1, c, p, q)."""
    return F.conv2d(search, kernel.transpose(0, 1), groups=kernel.shape[1])


def halve(channels: int) -> nn.Sequential:
    """From a correlation to a map of half its size."""
    convolution = nn.Conv2d(channels, WIDTH, 3, stride=2, padding=1, bias=False)
    return nn.Sequential(convolution, nn.BatchNorm2d(WIDTH), nn.ReLU(inplace=True))


def tower() -> list[nn.Module]:
    """The layers that both heads begin with."""
    layers: list[nn.Module] = []
    for _ in range(3):
        layers += [nn.Conv2d(WIDTH, WIDTH, 3, padding=1), nn.GroupNorm(32, WIDTH), nn.ReLU()]
    return layers


def tokens(maps: Tensor) -> Tensor:
    """(1, c, h, w) to (h * w, 1, c)."""
    return maps.flatten(2).permute(2, 0, 1)


class Grader(nn.Module):
    """Correlations, position code, a transformer that is given, heads."""

    def __init__(self, transformer: nn.Module) -> None:
        super().__init__()
        self.conv1, self.conv3, self.conv2 = halve(384), halve(384), halve(256)
        self.convloc = nn.Sequential(*tower(), nn.Conv2d(WIDTH, 4, 3, padding=1))
        self.convcls = nn.Sequential(*tower())
        self.row_embed = nn.Embedding(50, WIDTH // 2)
        self.col_embed = nn.Embedding(50, WIDTH // 2)
        self.transformer = transformer
        self.cls1 = nn.Conv2d(WIDTH, 2, 3, padding=1)
        self.cls2 = nn.Conv2d(WIDTH, 1, 3, padding=1)

    def forward(self, search: list[Tensor], template: list[Tensor]) -> tuple[Tensor, ...]:
        """Classes, logit and distances."""
        first = self.conv1(correlate(search[0], template[0]))
        second = self.conv3(correlate(search[1], template[1]))
        third = self.conv2(correlate(search[2], template[2]))
        rows, columns = first.shape[2:]
        x = self.col_embed(torch.arange(columns))[None].repeat(rows, 1, 1)
        y = self.row_embed(torch.arange(rows))[:, None].repeat(1, columns, 1)
        code = torch.cat([x, y], dim=-1).permute(2, 0, 1)[None]
        joined = self.transformer(code, first, second, third)
        joined = joined.permute(1, 2, 0).view(1, WIDTH, rows, columns)
        classes = self.convcls(joined)
        return self.cls1(classes), self.cls2(classes), self.convloc(joined)


class Modulation(nn.Module):
    """Channel attention."""

    def __init__(self) -> None:
        super().__init__()
        self.conv1 = nn.Sequential(nn.ConvTranspose2d(2 * WIDTH, WIDTH, 1))
        self.linear1 = nn.Conv2d(WIDTH, 32, 1, bias=False)
        self.linear2 = nn.Conv2d(32, WIDTH, 1, bias=False)
        self.gamma = nn.Parameter(torch.zeros(1))

    def forward(self, x: Tensor, y: Tensor) -> Tensor:
        """Two maps to one."""
        weight = self.linear2(F.relu(self.linear1(F.adaptive_avg_pool2d(y, 1))))
        change = self.conv1(torch.cat((x, y), dim=1)) * weight
        return x + self.gamma * change * x


class EncoderLayer(nn.Module):
    """One layer; memory of tokens is read as maps without a transpose, as the authors do."""

    def __init__(self) -> None:
        super().__init__()
        self.self_attn = nn.MultiheadAttention(WIDTH, 6)
        self.cross_attn = Modulation()
        self.eles = nn.Sequential(nn.Conv2d(WIDTH, WIDTH, 3, padding=1), nn.GroupNorm(32, WIDTH))
        self.linear1, self.linear2 = nn.Linear(WIDTH, 2048), nn.Linear(2048, WIDTH)
        self.norm0, self.norm1 = nn.LayerNorm(WIDTH), nn.LayerNorm(WIDTH)
        self.norm2 = nn.LayerNorm(WIDTH)

    def forward(self, src: Tensor, other: Tensor) -> Tensor:
        """Tokens of two stages to tokens."""
        count, batch, channels = src.shape
        side = int(count**0.5)
        attended = self.self_attn(self.norm0(src + other), self.norm0(src + other), src)[0]
        src = self.norm1(src + attended)
        shape = (batch, channels, side, side)
        src = self.cross_attn(src.contiguous().view(shape), other.contiguous().view(shape))
        src = src.view(batch, channels, -1).permute(2, 0, 1)
        return self.norm2(src + self.linear2(F.relu(self.linear1(src))))


class DecoderLayer(nn.Module):
    """One layer."""

    def __init__(self) -> None:
        super().__init__()
        self.self_attn = nn.MultiheadAttention(WIDTH, 6)
        self.multihead_attn = nn.MultiheadAttention(WIDTH, 6)
        self.linear1, self.linear2 = nn.Linear(WIDTH, 2048), nn.Linear(2048, WIDTH)
        self.norm1, self.norm2 = nn.LayerNorm(WIDTH), nn.LayerNorm(WIDTH)
        self.norm3 = nn.LayerNorm(WIDTH)

    def forward(self, tgt: Tensor, memory: Tensor) -> Tensor:
        """Tokens of a stage and of the encoder to tokens."""
        tgt = self.norm1(tgt + self.self_attn(tgt, tgt, tgt)[0])
        tgt = self.norm2(tgt + self.multihead_attn(tgt, memory, memory)[0])
        return self.norm3(tgt + self.linear2(F.relu(self.linear1(tgt))))


class Stack(nn.Module):
    """Layers and a last norm."""

    def __init__(self, *layers: nn.Module) -> None:
        super().__init__()
        self.layers = nn.ModuleList(layers)
        self.norm = nn.LayerNorm(WIDTH)

    def forward(self, tokens: Tensor, other: Tensor) -> Tensor:
        """Run them one after the other."""
        for layer in self.layers:
            tokens = layer(tokens, other)
        return self.norm(tokens)


class Transformer(nn.Module):
    """Encoder of stages 3 and 4, decoder of stage 5."""

    def __init__(self) -> None:
        super().__init__()
        self.encoder = Stack(EncoderLayer())
        self.decoder = Stack(DecoderLayer(), DecoderLayer())

    def forward(self, code: Tensor, first: Tensor, second: Tensor, third: Tensor) -> Tensor:
        """Maps to tokens."""
        memory = self.encoder(tokens(code + first), tokens(code + second))
        return self.decoder(tokens(third), memory)


class Peer(nn.Module):
    """The network; features of the template are kept from frame to frame."""

    def __init__(self, transformer: nn.Module) -> None:
        super().__init__()
        self.backbone = Backbone()
        self.grader = Grader(transformer)

    def embed(self, template: Tensor) -> list[Tensor]:
        """Once a sequence: what is kept of the template crop."""
        return self.backbone(template)

    def match(self, features: list[Tensor], search: Tensor) -> tuple[Tensor, ...]:
        """Once a frame."""
        return self.grader(self.backbone(search), features)

    def forward(self, template: Tensor, search: Tensor) -> tuple[Tensor, ...]:
        """Classes, logit and distances of crops (1, 3, 127, 127) and (1, 3, 287, 287)."""
        return self.match(self.embed(template), search)


def build() -> nn.Module:
    """The network in eval mode, with the official checkpoint's keys."""
    return Peer(Transformer()).eval()
