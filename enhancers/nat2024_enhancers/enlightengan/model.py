"""The generator of EnlightenGAN (Jiang et al., TIP 2021): a U-Net guided by darkness.

The attention map A of an image is 1 minus its grey value: dark places get more. The network adds
a residual, weighted by A, to the image, both on the scale -1..1.

Images are float32 (N, 3, H, W) in 0..1 of any size; the network itself pads and, above 2200
columns, halves them, as the official generator does. Names of modules are those of the official
state dict (without its prefix `module.`).
"""

from collections.abc import Iterable
from typing import NamedTuple

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from nat2024.networks.bands import bands_of, run_in_bands
from nat2024.networks.convolving import FastConv2d
from nat2024.networks.padding import pad_to_multiple

STRIDE = 16
"""Sides are padded to multiples of this inside the network."""

WIDEST = 2200
"""Images with more columns are halved first and enlarged again in the end."""

_WIDTHS = (32, 64, 128, 256, 512)
_SLOPE = 0.2
_GREY = (0.299, 0.587, 0.114)
_HALO = 2  # the two 3x3 convolutions of a level
# Three 3x3 convolutions and the enlargement see this many rows of the smaller features.
_SMALL_HALO = 2


class Prepared(NamedTuple):
    """What the network sees, and where the image lies in it."""

    image: Tensor
    attention: Tensor
    top: int
    left: int
    height: int
    width: int

    def cut(self, x: Tensor) -> Tensor:
        """The part of `x` that is no padding."""
        rows = slice(self.top, self.top + self.height)
        return x[..., rows, self.left : self.left + self.width]


class EnlightenGANNet(nn.Module):
    """EnlightenGAN's generator for images of any size."""

    def __init__(self) -> None:
        super().__init__()
        inputs = 4
        for level, width in enumerate(_WIDTHS, start=1):
            self._add_step(f"{level}_1", inputs, width)
            self._add_step(f"{level}_2", width, width)
            inputs = width
        for level, width in zip(range(6, 10), _WIDTHS[-2::-1], strict=True):
            self.add_module(f"deconv{level - 1}", FastConv2d(2 * width, width, 3, padding=1))
            self._add_step(f"{level}_1", 2 * width, width)
            self._add_step(f"{level}_2", width, width, norm=level < 9)
        self.conv10 = FastConv2d(_WIDTHS[0], 3, 1)

    def _add_step(self, name: str, inputs: int, outputs: int, *, norm: bool = True) -> None:
        self.add_module(f"conv{name}", FastConv2d(inputs, outputs, 3, padding=1))
        if norm:
            self.add_module(f"bn{name}", nn.BatchNorm2d(outputs))

    def forward(self, image: Tensor) -> Tensor:
        """(N, 3, H, W) in 0..1 to the enhanced image on the same scale, not limited to it."""
        given = self._prepare(image)
        latent = self._latent(given.image, given.attention)
        enhanced = (given.cut(latent + given.image) + 1) / 2
        if image.shape[-1] > WIDEST:
            enhanced = F.interpolate(enhanced, scale_factor=2, mode="bilinear")
        return enhanced[..., : image.shape[-2], : image.shape[-1]]

    def maps(self, image: Tensor) -> dict[str, Tensor]:
        """`gray` (the attention map), `latent` (what is added) and `output`, their sum with it.

        All on the network's scale of -1..1, without padding, of half size above 2200 columns.
        """
        given = self._prepare(image)
        latent = self._latent(given.image, given.attention)
        found = {"gray": given.attention, "latent": latent, "output": latent + given.image}
        return {name: given.cut(x) for name, x in found.items()}

    def _prepare(self, image: Tensor) -> Prepared:
        x = (image - 0.5) / 0.5
        attention = 1 - grey_of(x)
        if image.shape[-1] > WIDEST:
            # An odd side gets its last row or column twice, so that halving loses nothing.
            odd = (0, x.shape[-1] % 2, 0, x.shape[-2] % 2)
            x, attention = (
                F.avg_pool2d(F.pad(part, odd, mode="replicate"), 2) for part in (x, attention)
            )
        height, width = x.shape[-2:]
        attention, top, left = pad_to_multiple(attention, STRIDE, where="centre")
        x = pad_to_multiple(x, STRIDE, where="centre")[0]
        return Prepared(x, attention, top, left, height, width)

    def _latent(self, image: Tensor, attention: Tensor) -> Tensor:
        attentions = [attention]
        for _ in _WIDTHS[1:]:
            attentions.append(F.max_pool2d(attentions[-1], 2))
        x = torch.cat([image, attention], dim=1)
        # Batch statistics of channels-last data are inexact on a CPU, so training goes without.
        if not self.training:
            x = x.contiguous(memory_format=torch.channels_last)
        skips: list[Tensor] = []
        for level in range(1, len(_WIDTHS)):
            skip = self._encode(level, x)
            x = F.max_pool2d(skip, 2)
            skips.append(skip * attentions[level - 1])
            del skip  # at full size it needs more memory than whole levels below
        x = self._steps(self._steps(x, "5_1") * attentions[-1], "5_2")
        for level in range(6, 10):
            x = self._decode(level, x, skips.pop())
        return x.contiguous() * attention

    def _encode(self, level: int, x: Tensor) -> Tensor:
        names = (f"{level}_1", f"{level}_2")
        if self.training:  # batch statistics are those of the whole image
            return self._steps(x, *names)
        return run_in_bands(lambda rows: self._steps(rows, *names), x, halo=_HALO)

    def _decode(self, level: int, deep: Tensor, skip: Tensor) -> Tensor:
        """One level, in bands of rows: the large ones need most of the memory."""
        parts = []
        for start, stop in self._bands(skip):
            above = max(start // 2 - _SMALL_HALO, 0)
            below = stop // 2 + _SMALL_HALO
            x = self._join(level, deep[..., above:below, :], skip[..., 2 * above : 2 * below, :])
            x = self._steps(x, f"{level}_1")
            x = self._steps(x, f"{level}_2") if level < 9 else self._last(x)
            parts.append(x[..., start - 2 * above : stop - 2 * above, :])
        return parts[0] if len(parts) == 1 else torch.cat(parts, dim=-2)

    def _last(self, x: Tensor) -> Tensor:
        x = F.leaky_relu_(self._layer("conv9_2", x), _SLOPE)
        return self.conv10(x)  # type: ignore[no-any-return]

    def _bands(self, x: Tensor) -> Iterable[tuple[int, int]]:
        count, _, height, width = x.shape
        return [(0, height)] if self.training else bands_of(count, height, width, stride=2)

    def _join(self, level: int, x: Tensor, skip: Tensor) -> Tensor:
        x = F.interpolate(x, scale_factor=2, mode="bilinear", align_corners=False)
        return torch.cat([self._layer(f"deconv{level - 1}", x), skip], dim=1)

    def _steps(self, x: Tensor, *names: str) -> Tensor:
        for name in names:
            x = self._layer(f"bn{name}", F.leaky_relu_(self._layer(f"conv{name}", x), _SLOPE))
        return x

    def _layer(self, name: str, x: Tensor) -> Tensor:
        return self.get_submodule(name)(x)  # type: ignore[no-any-return]


def grey_of(image: Tensor) -> Tensor:
    """Grey value in 0..1, (N, 1, H, W), of images (N, 3, H, W) in -1..1 and RGB order."""
    red, green, blue = (image + 1).chunk(3, dim=1)
    return (_GREY[0] * red + _GREY[1] * green + _GREY[2] * blue) / 2
