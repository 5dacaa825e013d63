"""The network of HighlightNet (Fu et al., IROS 2022), symbols as in the official code.

The brightness v of a pixel is raised to the power g^r: r is estimated for every pixel (the range
mask), g for the whole image by a small Transformer. What lies below a second level b of the image
is darkened again (soft truncation). The three colours keep their ratios.

Images are float32 (N, 3, H, W) of any size. Names of modules are those of the official state dict.
"""

from collections.abc import Callable

import torch
import torch.nn.functional as functional
from torch import Tensor, nn

from nat2024.networks.bands import run_in_bands

_FEATURES = 4
_HALO = 7  # seven 3x3 convolutions one after the other
_BAND = 1 << 18  # rows of the halo are a tenth of a band of a 1920 pixels wide image
_SMALLEST = 1e-6
_DARK = 0.04  # brightness up to which a pixel counts as noise in training
_SIDE = 32  # what the Transformer sees, before a convolution halves it
_TOKEN = 16


class Block(nn.Module):
    """Post-norm self-attention; `norm0` is in the official state dict and unused."""

    def __init__(self, dropout: float) -> None:
        super().__init__()
        self.self_attn = nn.MultiheadAttention(_TOKEN, 8, dropout, batch_first=True)
        self.linear1 = nn.Linear(_TOKEN, 128)
        self.linear2 = nn.Linear(128, _TOKEN)
        self.norm0 = nn.LayerNorm(_TOKEN)
        self.norm1 = nn.LayerNorm(_TOKEN)
        self.norm2 = nn.LayerNorm(_TOKEN)
        self.dropout = nn.Dropout(dropout)

    def forward(self, tokens: Tensor) -> Tensor:
        """(N, L, 16) to the same shape."""
        attended = self.self_attn(tokens, tokens, tokens, need_weights=False)[0]
        middle = self.norm1(tokens + self.dropout(attended))
        hidden = self.dropout(functional.relu(self.linear1(middle)))
        return self.norm2(middle + self.dropout(self.linear2(hidden)))  # type: ignore[no-any-return]


class HighlightNet(nn.Module):
    """HighlightNet for images of any size.

    Args:
        detach_levels: whether the levels of an image are constants in training, as in the official
            code, whose Transformer therefore keeps its initial weights; False trains it.
        dropout: in the Transformer, in training.
    """

    def __init__(self, *, detach_levels: bool = True, dropout: float = 0.1) -> None:
        super().__init__()
        self.detach_levels = detach_levels
        self.e_conv1 = nn.Conv2d(1, _FEATURES, 3, padding=1)
        self.e_conv2 = nn.Conv2d(_FEATURES, _FEATURES, 3, padding=1)
        self.e_conv3 = nn.Conv2d(_FEATURES, _FEATURES, 3, padding=1)
        self.e_conv4 = nn.Conv2d(_FEATURES, _FEATURES, 3, padding=1)
        self.e_conv5 = nn.Conv2d(2 * _FEATURES, _FEATURES, 3, padding=1)
        self.e_conv6 = nn.Conv2d(2 * _FEATURES, _FEATURES, 3, padding=1)
        self.e_conv7 = nn.Conv2d(2 * _FEATURES, 1, 3, padding=1)
        self.model = nn.Sequential(
            nn.Conv2d(1, _TOKEN, 3, 2, 1),
            nn.LeakyReLU(0.2),
            nn.InstanceNorm2d(_TOKEN, affine=True),
        )
        self.TF = Block(dropout)
        self.F = nn.Conv2d(_TOKEN, 2, _SIDE // 2)

    def forward(self, image: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Enhance images.

        Returns:
            The enhanced images (N, 3, H, W), not clamped (slightly below 0 and above 1 occur); the
            range mask r (N, 1, H, W, 0..1); and t (N, 3, H, W), the enhanced images where the
            given ones are nearly black, else 0.
        """
        value = _brightness(image)
        mask = self._range_mask(value)
        enhanced = _adjust(image, value, mask, self.levels(image))
        dark = value + _SMALLEST <= _DARK
        return enhanced, mask, torch.where(dark, enhanced, torch.zeros_like(enhanced))

    def enhance(self, image: Tensor) -> Tensor:
        """The enhanced images of `forward` alone, with memory that does not grow with them."""
        levels = self.levels(image)
        return self.enhance_in_bands(image, lambda band: self.adjust(band, levels))

    @staticmethod
    def enhance_in_bands(image: Tensor, adjust: Callable[[Tensor], Tensor]) -> Tensor:
        """Enhance band by band with what stands for `adjust` under the image's own levels."""
        return run_in_bands(adjust, image, halo=_HALO, pixels=_BAND)

    def adjust(self, image: Tensor, levels: Tensor) -> Tensor:
        """Enhance (N, 3, H, W), a whole image or a band of its rows, with given levels (N, 2)."""
        value = _brightness(image)
        return _adjust(image, value, self._range_mask(value), levels)

    def levels(self, image: Tensor) -> Tensor:
        """l_g and l_b of every image, (N, 2), 0..1."""
        small = functional.interpolate(image, size=(_SIDE, _SIDE))  # nearest
        features = self.model(_brightness(small))
        tokens = self.TF(features.flatten(2).transpose(1, 2))
        # Its kernel covers all tokens, so that a matrix product does the same in less time.
        answer = functional.linear(
            tokens.transpose(1, 2).flatten(1), self.F.weight.flatten(1), self.F.bias
        )
        levels = torch.sigmoid(answer)
        return levels.detach() if self.detach_levels else levels

    def _range_mask(self, value: Tensor) -> Tensor:
        """r, (N, 1, H, W), of the brightness (N, 1, H, W)."""
        x1 = functional.relu_(self.e_conv1(value))
        x1 = x1.contiguous(memory_format=torch.channels_last)
        x2, part_of_7 = _convolve_both(x1, self.e_conv2, self.e_conv7)
        x3, part_of_6 = _convolve_both(x2, self.e_conv3, self.e_conv6)
        x4, part_of_5 = _convolve_both(x3, self.e_conv4, self.e_conv5)
        x5 = functional.relu_(_convolve_rest(x4, self.e_conv5, part_of_5))
        x6 = functional.relu_(_convolve_rest(x5, self.e_conv6, part_of_6))
        return torch.sigmoid(_convolve_rest(x6, self.e_conv7, part_of_7)).contiguous()


def _brightness(image: Tensor) -> Tensor:
    return image.mean(dim=1, keepdim=True)


def _convolve_both(x: Tensor, layer: nn.Conv2d, later: nn.Conv2d) -> tuple[Tensor, Tensor]:
    """Features of `layer`, and what `later` gives for the first half of its input, which is `x`.

    Both in one convolution: with so few channels eight outputs cost as much as four.
    """
    assert layer.bias is not None
    assert later.bias is not None
    weight = torch.cat([layer.weight, later.weight[:, :_FEATURES]])
    bias = torch.cat([layer.bias, later.bias])
    both = functional.conv2d(x, weight, bias, padding=1)
    return functional.relu(both[:, :_FEATURES]), both[:, _FEATURES:]


def _convolve_rest(x: Tensor, layer: nn.Conv2d, part: Tensor) -> Tensor:
    """What `layer` gives, whose second half of inputs is `x`, given the part of the first half."""
    return functional.conv2d(x, layer.weight[:, _FEATURES:], padding=1).add_(part)


def _adjust(image: Tensor, value: Tensor, mask: Tensor, levels: Tensor) -> Tensor:
    l_g, l_b = (level[:, None, None, None] for level in levels.unbind(dim=1))
    power = torch.pow(0.1 * l_g + 0.2, mask)
    brightened = torch.pow(value.clamp(_SMALLEST, 1 - _SMALLEST), power)
    cut = 400 * torch.pow(0.04 * l_b + 0.06 - value, 3)
    cut = torch.where(cut < 1e-5, _SMALLEST, cut)
    return image * ((brightened - cut) / (value + _SMALLEST))
