"""SCT written plainly, layer by layer, as a yardstick for speed and memory.

`build()` gives the network with the names of the official state dict.
"""

import torch
import torch.nn.functional as F
from torch import Tensor, nn

WINDOW = 4


class ConvBlock(nn.Module):
    """Two convolutions, each with LeakyReLU."""

    def __init__(self, inputs: int, outputs: int) -> None:
        super().__init__()
        self.block = nn.Sequential(
            nn.Conv2d(inputs, outputs, 3, padding=1),
            nn.LeakyReLU(inplace=True),
            nn.Conv2d(outputs, outputs, 3, padding=1),
            nn.LeakyReLU(inplace=True),
        )

    def forward(self, x: Tensor) -> Tensor:
        """Keeps height and width."""
        return self.block(x)


class Projection(nn.Module):
    """Queries, and keys with values."""

    def __init__(self, dim: int) -> None:
        super().__init__()
        self.to_q = nn.Linear(dim, dim)
        self.to_kv = nn.Linear(dim, 2 * dim)

    def forward(self, x: Tensor, heads: int) -> tuple[Tensor, Tensor, Tensor]:
        """(B, L, C) to three (B, heads, L, C / heads)."""
        count, length, dim = x.shape
        q = self.to_q(x).reshape(count, length, heads, dim // heads).permute(0, 2, 1, 3)
        kv = self.to_kv(x).reshape(count, length, 2, heads, dim // heads).permute(2, 0, 3, 1, 4)
        return q, kv[0], kv[1]


class WindowAttention(nn.Module):
    """Attention inside windows with a relative position bias."""

    def __init__(self, dim: int, heads: int) -> None:
        super().__init__()
        self.heads = heads
        self.scale = (dim // heads) ** -0.5
        self.relative_position_bias_table = nn.Parameter(torch.zeros((2 * WINDOW - 1) ** 2, heads))
        rows, columns = torch.meshgrid(torch.arange(WINDOW), torch.arange(WINDOW), indexing="ij")
        places = torch.stack([rows.flatten(), columns.flatten()])
        distance = places[:, :, None] - places[:, None, :] + WINDOW - 1
        index = distance[0] * (2 * WINDOW - 1) + distance[1]
        self.register_buffer("relative_position_index", index)
        self.qkv = Projection(dim)
        self.proj = nn.Linear(dim, dim)

    def forward(self, x: Tensor) -> Tensor:
        """(windows, 16, C) to the same."""
        q, k, v = self.qkv(x, self.heads)
        attention = (q * self.scale) @ k.transpose(-2, -1)
        bias = self.relative_position_bias_table[self.relative_position_index.view(-1)]
        bias = bias.view(WINDOW**2, WINDOW**2, -1).permute(2, 0, 1)
        attention = (attention + bias.unsqueeze(0)).softmax(dim=-1)
        return self.proj((attention @ v).transpose(1, 2).reshape(x.shape))


class Step(nn.Module):
    """Convolution without bias and BatchNorm."""

    def __init__(self, convolution: nn.Module, dim: int) -> None:
        super().__init__()
        self.conv = nn.Sequential(convolution, nn.BatchNorm2d(dim))

    def forward(self, x: Tensor) -> Tensor:
        """Keeps the shape."""
        return F.gelu(self.conv(x))


class Mlp(nn.Module):
    """Feed-forward layer with a residual convolution on the grid of the tokens."""

    def __init__(self, dim: int) -> None:
        super().__init__()
        hidden = 4 * dim
        self.linear1 = nn.Sequential(nn.Linear(dim, hidden), nn.GELU())
        self.block = nn.Sequential(
            Step(nn.Conv2d(hidden, hidden, 1, bias=False), hidden),
            Step(nn.Conv2d(hidden, hidden, 3, padding=1, groups=hidden, bias=False), hidden),
        )
        self.linear2 = nn.Sequential(nn.Linear(hidden, dim))

    def forward(self, x: Tensor) -> Tensor:
        """(N, L, C) to the same."""
        side = int(x.shape[1] ** 0.5)
        y = self.linear1(x).transpose(1, 2).unflatten(2, (side, side)).contiguous()
        y = y + self.block(y)
        return self.linear2(y.flatten(2).transpose(1, 2))


class Block(nn.Module):
    """Window attention and feed-forward layer."""

    def __init__(self, dim: int) -> None:
        super().__init__()
        self.norm1 = nn.LayerNorm(dim)
        self.attn = WindowAttention(dim, 4)
        self.norm2 = nn.LayerNorm(dim)
        self.mlp = Mlp(dim)

    def forward(self, x: Tensor) -> Tensor:
        """(N, L, C) to the same."""
        count, length, dim = x.shape
        side = int(length**0.5)
        windows = self.norm1(x).view(count, side // WINDOW, WINDOW, side // WINDOW, WINDOW, dim)
        windows = windows.permute(0, 1, 3, 2, 4, 5).reshape(-1, WINDOW**2, dim)
        y = self.attn(windows).view(count, side // WINDOW, side // WINDOW, WINDOW, WINDOW, dim)
        x = x + y.permute(0, 1, 3, 2, 4, 5).reshape(count, length, dim)
        return x + self.mlp(self.norm2(x))


class Layer(nn.Module):
    """One block."""

    def __init__(self, dim: int) -> None:
        super().__init__()
        self.blocks = nn.ModuleList([Block(dim)])

    def forward(self, x: Tensor) -> Tensor:
        """(N, L, C) to the same."""
        for block in self.blocks:
            x = block(x)
        return x


class OutputProjection(nn.Module):
    """A convolution."""

    def __init__(self) -> None:
        super().__init__()
        self.proj = nn.Sequential(nn.Conv2d(256, 256, 3, padding=1))

    def forward(self, x: Tensor) -> Tensor:
        """Keeps the shape."""
        return self.proj(x)


class Network(nn.Module):
    """Convolutional encoder and decoder around two transformer layers."""

    def __init__(self) -> None:
        super().__init__()
        widths = (3, 32, 64, 128, 256)
        for level in range(1, 5):
            width = widths[level]
            setattr(self, f"ConvBlock{level}", ConvBlock(widths[level - 1], width))
            setattr(self, f"pool{level}", nn.Conv2d(width, width, 4, 2, 1))
        self.encoderlayer_0 = Layer(256)
        self.encoderlayer_1 = Layer(64)
        self.output_proj = OutputProjection()
        inputs = 256
        for level, width in zip(range(6, 10), (256, 128, 64, 32), strict=True):
            setattr(self, f"upv{level}", nn.ConvTranspose2d(inputs, width, 2, 2))
            setattr(self, f"ConvBlock{level}", ConvBlock(2 * width, width))
            inputs = width
        self.conv10 = nn.Sequential(nn.Conv2d(32, 6, 3, padding=1))

    def forward(self, batch: Tensor) -> Tensor:
        """(N, 3, H, W) in 0..1 to the enhanced image."""
        maps = self.estimate(batch)[..., 8:120, 8:120]
        maps = F.interpolate(maps, size=batch.shape[2:], mode="bilinear", align_corners=False)
        x_r, x_n = maps[:, :3], maps[:, 3:]
        x = batch
        for _ in range(8):
            x = x + x_n
            x = x + x_r * (torch.pow(x, 2) - x)
        return x

    def estimate(self, batch: Tensor) -> Tensor:
        """(N, 6, 128, 128)."""
        x = F.interpolate(batch, size=(112, 112), mode="bilinear", align_corners=False)
        x = F.pad(x, (8, 8, 8, 8), mode="reflect")
        skips = []
        for level in range(1, 5):
            skips.append(getattr(self, f"ConvBlock{level}")(x))
            x = getattr(self, f"pool{level}")(skips[-1])
        x = self.encoderlayer_0(x.flatten(2).transpose(1, 2)).transpose(1, 2)
        x = self.output_proj(self.encoderlayer_1(x).reshape(-1, 256, 8, 8))
        for level in range(6, 10):
            x = torch.cat([getattr(self, f"upv{level}")(x), skips[9 - level]], dim=1)
            x = getattr(self, f"ConvBlock{level}")(x)
        return torch.tanh(self.conv10(x))


def build() -> nn.Module:
    """The network in evaluation mode."""
    return Network().eval()
