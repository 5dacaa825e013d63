"""The three networks of KinD++ (Zhang et al., IJCV 2021), written for PyTorch.

An image is decomposed into reflectance R and illumination I; the reflectance is restored with the
illumination as a guide, and blended with the image where that is bright. Names of modules are
those of the authors' TensorFlow variables.

Images are float32 (N, 3, H, W) in 0..1, illuminations (N, 1, H, W), sides multiples of 4.
"""

import math
from typing import cast

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from nat2024.errors import ArrayContract
from nat2024.networks.bands import run_in_bands
from nat2024.networks.convolving import FastConv2d
from nat2024.networks.folding import Derived, may_derive

STRIDE = 4
"""The networks pool twice."""

_SLOPE = 0.2
_HALO = 24  # ten 3x3 convolutions see a row each, four multi-scale parts three each
_DECOMPOSITION_HALO = 16  # convolutions at 1, 1/2 and 1/4 of the size
_BAND_PIXELS = 1 << 19
_SIGMA = 3.0
_RADIUS = 12  # four sigma
_GREY = (0.2125, 0.7154, 0.0721)


def _convolution(inputs: int, outputs: int, size: int = 3, *, bias: bool = True) -> nn.Conv2d:
    return FastConv2d(inputs, outputs, size, padding=size // 2, bias=bias)


def _leaky(x: Tensor) -> Tensor:
    return F.leaky_relu(x, _SLOPE, inplace=not torch.is_grad_enabled())


class Decomposition(nn.Module):
    """Splits an image into reflectance and illumination."""

    def __init__(self) -> None:
        super().__init__()
        self.g_conv1_1 = _convolution(3, 32)
        self.g_conv2_1 = _convolution(32, 64)
        self.g_conv3_1 = _convolution(64, 128)
        self.g_up_1 = nn.ConvTranspose2d(128, 64, 2, 2, bias=False)
        self.g_conv8_1 = _convolution(128, 64)
        self.g_up_2 = nn.ConvTranspose2d(64, 32, 2, 2, bias=False)
        self.g_conv9_1 = _convolution(64, 32)
        self.g_conv10 = _convolution(32, 3, 1)
        self.l_conv1_2 = _convolution(32, 32)
        self.l_conv1_4 = _convolution(64, 1, 1)

    def forward(self, image: Tensor) -> Tensor:
        """(N, 3, H, W) to R and I one after the other, (N, 4, H, W) in 0..1."""
        first = _leaky(self.g_conv1_1(image))
        second = _leaky(self.g_conv2_1(F.max_pool2d(first, 2)))
        third = _leaky(self.g_conv3_1(F.max_pool2d(second, 2)))
        up = torch.cat([self.g_up_1(third), second], dim=1)
        up = _leaky(self.g_conv8_1(up))
        up = torch.cat([self.g_up_2(up), first], dim=1)
        last = _leaky(self.g_conv9_1(up))
        light = torch.cat([_leaky(self.l_conv1_2(first)), last], dim=1)
        return torch.sigmoid(torch.cat([self.g_conv10(last), self.l_conv1_4(light)], dim=1))


class Scale(nn.Module):
    """One scale of a multi-scale part: pools, convolves, normalises, and enlarges again."""

    def __init__(self, channels: int, pooling: int) -> None:
        super().__init__()
        self.pooling = pooling
        self.pu_conv = _convolution(channels, channels, 1 if pooling == 4 else 3)
        self.batch_normalization = nn.BatchNorm2d(channels, eps=1e-3, momentum=0.01)
        ups = {1: (), 2: ("conv_up",), 4: ("conv_up_1", "conv_up")}[pooling]
        for name in ups:
            self.add_module(name, nn.ConvTranspose2d(channels, channels, 2, 2))
        self.ups = ups
        self._folded = Derived(self, self._fold)

    def forward(self, x: Tensor) -> Tensor:
        """(N, channels, H, W) to the same shape."""
        x = F.max_pool2d(x, self.pooling) if self.pooling > 1 else x
        if may_derive(self):
            weight, bias, low, high = self._folded()
            x = F.conv2d(x, weight, bias, padding=weight.shape[-1] // 2)
            x = torch.clamp_(x, low, high)
        else:
            x = F.relu(self.batch_normalization(F.relu(self.pu_conv(x))))
        for name in self.ups:
            x = F.relu(self.get_submodule(name)(x), inplace=not torch.is_grad_enabled())
        return x

    def _fold(self) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        # relu(a relu(x) + b) is a x + b limited to max(b, 0).. where a > 0, to 0..max(b, 0) else
        norm = self.batch_normalization
        if norm.running_var is None or norm.running_mean is None:
            msg = "BatchNorm without running statistics"
            raise ValueError(msg)
        scale = norm.weight.double() * (norm.running_var.double() + norm.eps).rsqrt()
        shift = norm.bias.double() - norm.running_mean.double() * scale
        bias = self.pu_conv.bias
        if bias is None:
            msg = "a convolution without bias"
            raise ValueError(msg)
        weight = self.pu_conv.weight.double() * scale.view(-1, 1, 1, 1)
        floor = shift.clamp_min(0.0)
        low = torch.where(scale > 0, floor, torch.zeros_like(floor)).view(1, -1, 1, 1)
        high = torch.where(scale > 0, torch.full_like(floor, math.inf), floor).view(1, -1, 1, 1)
        folded = (weight, bias.double() * scale + shift, low, high)
        first, second, third, fourth = (part.to(self.pu_conv.weight.dtype) for part in folded)
        return first, second, third, fourth


class Guide(nn.Module):
    """The convolution of the illumination that tells how strongly each place takes part."""

    def __init__(self) -> None:
        super().__init__()
        self.conv = _convolution(1, 1, bias=False)

    def forward(self, light: Tensor) -> Tensor:
        """(N, 1, H, W) to the same shape, 0..1."""
        return torch.sigmoid(self.conv(light))


class Restoration(nn.Module):
    """Restores the reflectance, guided by the illumination at four places (MSIA)."""

    def __init__(self) -> None:
        super().__init__()
        widths = ((3, 32, 64), (64, 128, 256), (256, 512, 256), (256, 128, 64))
        for part, (inputs, middle, outputs) in enumerate(widths, 1):
            name = f"de_conv{part}"
            self.add_module(f"{name}_1", _convolution(inputs, middle))
            self.add_module(f"{name}_2", _convolution(middle, outputs))
            self.add_module(name, Guide())
            for pooling in (1, 2, 4):
                self.add_module(f"{name}pu{pooling}", Scale(outputs, pooling))
            self.add_module(f"{name}multi_scale_feature", _convolution(4 * outputs, outputs, 1))
        self.de_conv5_1 = _convolution(64, 32)
        self.de_conv10 = _convolution(32, 3)

    def forward(self, both: Tensor) -> Tensor:
        """R and I one after the other, (N, 4, H, W), to the restored R (N, 3, H, W) in 0..1."""
        x, light = both[:, :3], both[:, 3:]
        for part in range(1, 5):
            name = f"de_conv{part}"
            x = _leaky(self.get_submodule(f"{name}_1")(x))
            x = _leaky(self.get_submodule(f"{name}_2")(x))
            x = self._attend(name, x, light)
        return torch.sigmoid(self.de_conv10(_leaky(self.de_conv5_1(x))))

    def _attend(self, name: str, x: Tensor, light: Tensor) -> Tensor:
        guided = x * self.get_submodule(name)(light)
        merge = cast("nn.Conv2d", self.get_submodule(f"{name}multi_scale_feature"))
        # One scale after the other, without copying all of them together.
        of_guided, *of_scales = merge.weight.chunk(4, dim=1)
        answer = F.conv2d(guided, of_guided, merge.bias)
        for pooling, weight in zip((1, 2, 4), of_scales, strict=True):
            answer += F.conv2d(self.get_submodule(f"{name}pu{pooling}")(guided), weight)
        return F.relu(answer, inplace=not torch.is_grad_enabled())


class Adjustment(nn.Module):
    """Brightens an illumination by a given ratio."""

    def __init__(self) -> None:
        super().__init__()
        self.conv_1 = _convolution(2, 32)
        self.conv_2 = _convolution(32, 32)
        self.conv_3 = _convolution(32, 32)
        self.conv_4 = _convolution(32, 1)

    def forward(self, light: Tensor, ratio: float) -> Tensor:
        """(N, 1, H, W) to the same shape, 0..1."""
        x = torch.cat([light, torch.full_like(light, ratio)], dim=1)
        for layer in (self.conv_1, self.conv_2, self.conv_3, self.conv_4):
            x = _leaky(layer(x))
        return torch.sigmoid(x)


class KindPlusPlusNet(nn.Module):
    """KinD++ for images that were normalised to 0..1, sides multiples of 4."""

    def __init__(self) -> None:
        super().__init__()
        self.DecomNet = Decomposition()
        self.Denoise_Net = Restoration()
        self.I_enhance_Net = Adjustment()

    def forward(self, image: Tensor, ratio: float | None = None) -> Tensor:
        """Enhance normalised images.

        Args:
            image: (N, 3, H, W) in 0..1.
            ratio: how much brighter the illumination shall be; None leaves that part out.

        Returns:
            (N, 3, H, W), a blend of the image and its restored reflectance.

        Raises:
            ArrayContract: a side is no multiple of 4.
        """
        both, restored, low = self._restore(image)
        light = both[:, 3:]
        dark = restored * low
        if ratio is not None:
            dark = dark * self.I_enhance_Net(light, ratio)
        return light * image + (1.0 - light) * dark

    def maps(self, image: Tensor, ratio: float) -> dict[str, Tensor]:
        """`R`, `I`, `restored`, `low_i` and `adjusted_I` (for `ratio`) of normalised images."""
        both, restored, low = self._restore(image)
        adjusted = self.I_enhance_Net(both[:, 3:], ratio)
        reflectance, light = both[:, :3], both[:, 3:]
        return {
            "R": reflectance,
            "I": light,
            "restored": restored,
            "low_i": low,
            "adjusted_I": adjusted,
        }

    def _restore(self, image: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        height, width = image.shape[-2:]
        if height % STRIDE or width % STRIDE:
            msg = f"KinD++ takes sides that are multiples of {STRIDE}, not {width}x{height}"
            raise ArrayContract(msg)
        # In bands: for a full frame one feature map of 512 channels alone takes 4 GB.
        both = _in_bands(self.DecomNet, image.contiguous(), _DECOMPOSITION_HALO)
        restored = _in_bands(self.Denoise_Net, both, _HALO)
        return both, restored, _lightness(both[:, :3])


def _in_bands(network: nn.Module, image: Tensor, halo: int) -> Tensor:
    return run_in_bands(network, image, halo=halo, stride=STRIDE, pixels=_BAND_PIXELS)


def _lightness(reflectance: Tensor) -> Tensor:
    """How light the surroundings of each pixel are, (N, 3, H, W) to (N, 1, H, W), at most 1."""
    weights = reflectance.new_tensor(_GREY).view(1, 3, 1, 1)
    grey = (reflectance * weights).sum(dim=1, keepdim=True)
    places = torch.arange(-_RADIUS, _RADIUS + 1, dtype=torch.float64)
    kernel = torch.exp(-0.5 * (places / _SIGMA) ** 2)
    kernel = (kernel / kernel.sum()).to(grey)
    grey = F.pad(grey, (_RADIUS,) * 4, mode="replicate")
    grey = F.conv2d(F.conv2d(grey, kernel.view(1, 1, -1, 1)), kernel.view(1, 1, 1, -1))
    return (2.0 * grey).clamp_min(0.0).sqrt().clamp_max(1.0)


def normalise(batch: Tensor) -> Tensor:
    """Stretch each image of (N, 3, H, W) so that its least value becomes 0 and its largest 1."""
    low, high = batch.amin(dim=(1, 2, 3), keepdim=True), batch.amax(dim=(1, 2, 3), keepdim=True)
    return (batch - low) / (high - low).clamp_min(0.001)
