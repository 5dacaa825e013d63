"""HighlightNet (Fu et al., IROS 2022) with its layers written plainly, as a yardstick for speed.

What the official code computes: the features put together before each wide layer,
`nn.MultiheadAttention` asked for its weights, powers and masks over the whole image.
"""

import torch
import torch.nn.functional
from torch import Tensor, nn


class Block(nn.Module):
    """One post-norm self-attention layer; `norm0` is in the checkpoint and unused."""

    def __init__(self) -> None:
        super().__init__()
        self.self_attn = nn.MultiheadAttention(16, 8, dropout=0.1)
        self.linear1 = nn.Linear(16, 128)
        self.linear2 = nn.Linear(128, 16)
        self.norm0 = nn.LayerNorm(16)
        self.norm1 = nn.LayerNorm(16)
        self.norm2 = nn.LayerNorm(16)
        self.dropout = nn.Dropout(0.1)

    def forward(self, tokens: Tensor) -> Tensor:
        """Tokens (L, N, 16) to the same shape."""
        attended = self.self_attn(tokens, tokens, tokens)[0]
        tokens = self.norm1(tokens + self.dropout(attended))
        hidden = self.linear2(self.dropout(torch.relu(self.linear1(tokens))))
        return self.norm2(tokens + self.dropout(hidden))


class Peer(nn.Module):
    """The network, which takes any size."""

    def __init__(self) -> None:
        super().__init__()
        self.relu = nn.ReLU(inplace=True)
        self.e_conv1 = nn.Conv2d(1, 4, 3, padding=1)
        self.e_conv2 = nn.Conv2d(4, 4, 3, padding=1)
        self.e_conv3 = nn.Conv2d(4, 4, 3, padding=1)
        self.e_conv4 = nn.Conv2d(4, 4, 3, padding=1)
        self.e_conv5 = nn.Conv2d(8, 4, 3, padding=1)
        self.e_conv6 = nn.Conv2d(8, 4, 3, padding=1)
        self.e_conv7 = nn.Conv2d(8, 1, 3, padding=1)
        self.model = nn.Sequential(
            nn.Conv2d(1, 16, 3, 2, 1), nn.LeakyReLU(0.2), nn.InstanceNorm2d(16, affine=True)
        )
        self.TF = Block()
        self.F = nn.Conv2d(16, 2, 16)

    def forward(self, batch: Tensor) -> Tensor:
        """Enhance (N, 3, H, W); no clamp."""
        value = batch.mean(dim=1, keepdim=True)
        level = self.levels(value)
        gain, floor = (0.1 * level[:, :1] + 0.2), (0.04 * level[:, 1:] + 0.06)
        base = torch.clamp(value, 1e-6, 1 - 1e-6)
        light = torch.pow(base, torch.pow(gain, self.exponents(value)))
        cut = 400 * torch.pow(floor - value, 3)
        cut = torch.where(cut < 1e-5, torch.full_like(cut, 1e-6), cut)
        return batch / (value + 1e-6) * (light - cut)

    def exponents(self, value: Tensor) -> Tensor:
        """The range mask r."""
        x1 = self.relu(self.e_conv1(value))
        x2 = self.relu(self.e_conv2(x1))
        x3 = self.relu(self.e_conv3(x2))
        x4 = self.relu(self.e_conv4(x3))
        x5 = self.relu(self.e_conv5(torch.cat([x3, x4], dim=1)))
        x6 = self.relu(self.e_conv6(torch.cat([x2, x5], dim=1)))
        return torch.sigmoid(self.e_conv7(torch.cat([x1, x6], dim=1)))

    def levels(self, value: Tensor) -> Tensor:
        """The two levels of an image, (N, 2, 1, 1)."""
        small = torch.nn.functional.interpolate(value, size=(32, 32))
        features = self.model(small)
        tokens = self.TF(features.flatten(2).permute(2, 0, 1))
        return torch.sigmoid(self.F(tokens.permute(1, 2, 0).reshape(features.shape)))


def build() -> nn.Module:
    """The network in eval mode, with the official checkpoint's keys."""
    return Peer().eval()
