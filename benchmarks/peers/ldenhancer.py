"""LDEnhancer (Yao et al., IROS 2024) with its layers written plainly, as a yardstick for speed.

What the official code computes, in eval mode: separate BatchNorms, `nn.MultiheadAttention` asked
for its weights, concatenated features, one iteration after the other.
"""

import torch
import torch.nn.functional as F
from torch import Tensor, nn


class Down(nn.Module):
    """Convolution with stride 2, BatchNorm, ReLU."""

    def __init__(self, inputs: int, outputs: int) -> None:
        super().__init__()
        self.conv = nn.Sequential(
            nn.Conv2d(inputs, outputs, 2, 2), nn.BatchNorm2d(outputs), nn.ReLU(inplace=True)
        )

    def forward(self, x: Tensor) -> Tensor:
        """Half the sides."""
        return self.conv(x)


class Up(nn.Module):
    """Transposed convolution with stride 2, BatchNorm, ReLU."""

    def __init__(self, inputs: int, outputs: int) -> None:
        super().__init__()
        self.upsample = nn.Sequential(
            nn.ConvTranspose2d(inputs, outputs, 2, 2),
            nn.BatchNorm2d(outputs),
            nn.ReLU(inplace=True),
        )

    def forward(self, x: Tensor) -> Tensor:
        """Twice the sides."""
        return self.upsample(x)


class Encoder(nn.Module):
    """Image to features at 1/16 of its size."""

    def __init__(self) -> None:
        super().__init__()
        self.d1, self.d2, self.d3, self.d4 = Down(3, 4), Down(4, 4), Down(4, 8), Down(8, 8)

    def forward(self, x: Tensor) -> Tensor:
        """(N, 3, H, W) to (N, 8, H / 16, W / 16)."""
        return self.d4(self.d3(self.d2(self.d1(x))))


class Decoder(nn.Module):
    """Features to an image."""

    def __init__(self) -> None:
        super().__init__()
        self.u1, self.u2, self.u3, self.u4 = Up(8, 8), Up(8, 4), Up(4, 4), Up(4, 3)

    def forward(self, x: Tensor) -> Tensor:
        """(N, 8, H / 16, W / 16) to (N, 3, H, W)."""
        return self.u4(self.u3(self.u2(self.u1(x))))


class AttentionLayer(nn.Module):
    """Transformer layer; tokens are (L, N, 8)."""

    def __init__(self) -> None:
        super().__init__()
        self.multihead_attn = nn.MultiheadAttention(8, 8, dropout=0.3)
        self.linear1, self.linear2 = nn.Linear(8, 64), nn.Linear(64, 8)
        self.norm1, self.norm2 = nn.LayerNorm(8), nn.LayerNorm(8)
        self.dropout = nn.Dropout(0.3)

    def forward(self, content: Tensor, light: Tensor, position: Tensor) -> Tensor:
        """Content tokens that have looked at the light tokens."""
        attended, _ = self.multihead_attn(content + position, light + position, value=light)
        content = self.norm1(content + self.dropout(attended))
        hidden = self.linear2(self.dropout(F.relu(self.linear1(content))))
        return self.norm2(content + self.dropout(hidden))


class CrossAttention(nn.Module):
    """Attention of content features to light features, with learned positions."""

    def __init__(self) -> None:
        super().__init__()
        self.layer = AttentionLayer()
        self.row_embed, self.col_embed = nn.Embedding(500, 4), nn.Embedding(500, 4)

    def forward(self, content: Tensor, light: Tensor) -> Tensor:
        """(N, 8, h, w) twice to (N, 8, h, w)."""
        count, channels, height, width = content.shape
        columns = self.col_embed(torch.arange(width, device=content.device))
        rows = self.row_embed(torch.arange(height, device=content.device))
        position = torch.cat(
            [
                columns.unsqueeze(0).repeat(height, 1, 1),
                rows.unsqueeze(1).repeat(1, width, 1),
            ],
            dim=-1,
        )
        position = position.flatten(0, 1).unsqueeze(1).repeat(1, count, 1)
        content, light = (x.flatten(2).permute(2, 0, 1) for x in (content, light))
        tokens = self.layer(content, light, position)
        return tokens.permute(1, 2, 0).reshape(count, channels, height, width)


class CurveEstimation(nn.Module):
    """Curve parameters of every pixel."""

    def __init__(self) -> None:
        super().__init__()
        self.e_conv1 = nn.Conv2d(3, 16, 3, 1, 1)
        self.e_conv2 = nn.Conv2d(16, 16, 3, 1, 1)
        self.e_conv3 = nn.Conv2d(16, 16, 3, 1, 1)
        self.e_conv4 = nn.Conv2d(32, 16, 3, 1, 1)
        self.e_conv5 = nn.Conv2d(32, 12, 3, 1, 1)
        self.relu = nn.ReLU(inplace=True)

    def forward(self, x: Tensor) -> Tensor:
        """(N, 3, H, W) to (N, 12, H, W)."""
        x1 = self.relu(self.e_conv1(x))
        x2 = self.relu(self.e_conv2(x1))
        x3 = self.relu(self.e_conv3(x2))
        x4 = self.relu(self.e_conv4(torch.cat([x2, x3], 1)))
        return torch.tanh(self.e_conv5(torch.cat([x1, x4], 1)))


class LDEnhancer(nn.Module):
    """The whole network."""

    def __init__(self) -> None:
        super().__init__()
        self.downsamplenet = Encoder()
        self.upsamplenet_light, self.upsamplenet_content = Decoder(), Decoder()
        self.CrossAttention = CrossAttention()
        self.decompose = nn.Conv2d(8, 8, 1)
        self.light_estimation, self.content_estimation = CurveEstimation(), CurveEstimation()

    def forward(self, batch: Tensor) -> Tensor:
        """(N, 3, H, W) of any size, padded to multiples of 16, to the unclamped enhanced batch."""
        height, width = batch.shape[-2:]
        image = F.pad(batch, (0, -width % 16, 0, -height % 16), mode="reflect")
        mixed = self.downsamplenet(image)
        light = self.decompose(mixed)
        content = self.CrossAttention(mixed - light, light)
        content_image = self.upsamplenet_content(content)
        light_image = self.upsamplenet_light(light)
        light_curves = torch.split(self.light_estimation(light_image), 3, dim=1)
        content_curves = torch.split(self.content_estimation(content_image), 3, dim=1)
        amounts = [e - s for e, s in zip(content_curves, light_curves, strict=True)]
        for amount in amounts:
            image = image + amount * (torch.pow(image, 2) - image)
        return image[..., :height, :width]


def build() -> nn.Module:
    """The network in eval mode, with the official checkpoint's keys."""
    return LDEnhancer().eval()
