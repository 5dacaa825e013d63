"""KinD++ (Zhang et al., IJCV 2021) with its layers written plainly, as a yardstick for speed.

What the official code computes at test time without adjustment: the whole image at once, BatchNorm
as a layer, the scales of each multi-scale part put together before they are merged.
"""

import torch
import torch.nn.functional as F
from torch import Tensor, nn


def conv(inputs: int, outputs: int, size: int = 3, *, bias: bool = True) -> nn.Conv2d:
    """A convolution that keeps the size."""
    return nn.Conv2d(inputs, outputs, size, padding=size // 2, bias=bias)


def lrelu(x: Tensor) -> Tensor:
    """The larger of x and x / 5."""
    return torch.maximum(0.2 * x, x)


class DecomNet(nn.Module):
    """Image to reflectance and illumination."""

    def __init__(self) -> None:
        super().__init__()
        self.g_conv1_1 = conv(3, 32)
        self.g_conv2_1 = conv(32, 64)
        self.g_conv3_1 = conv(64, 128)
        self.g_up_1 = nn.ConvTranspose2d(128, 64, 2, 2, bias=False)
        self.g_conv8_1 = conv(128, 64)
        self.g_up_2 = nn.ConvTranspose2d(64, 32, 2, 2, bias=False)
        self.g_conv9_1 = conv(64, 32)
        self.g_conv10 = conv(32, 3, 1)
        self.l_conv1_2 = conv(32, 32)
        self.l_conv1_4 = conv(64, 1, 1)

    def forward(self, image: Tensor) -> tuple[Tensor, Tensor]:
        """R and I."""
        c1 = lrelu(self.g_conv1_1(image))
        c2 = lrelu(self.g_conv2_1(F.max_pool2d(c1, 2)))
        c3 = lrelu(self.g_conv3_1(F.max_pool2d(c2, 2)))
        c8 = lrelu(self.g_conv8_1(torch.cat([self.g_up_1(c3), c2], 1)))
        c9 = lrelu(self.g_conv9_1(torch.cat([self.g_up_2(c8), c1], 1)))
        light = lrelu(self.l_conv1_2(c1))
        light = self.l_conv1_4(torch.cat([light, c9], 1))
        return torch.sigmoid(self.g_conv10(c9)), torch.sigmoid(light)


class Guide(nn.Module):
    """Attention from the illumination."""

    def __init__(self) -> None:
        super().__init__()
        self.conv = conv(1, 1, bias=False)

    def forward(self, light: Tensor) -> Tensor:
        """How strongly each place takes part."""
        return torch.sigmoid(self.conv(light))


class Scale(nn.Module):
    """A scale of a multi-scale part."""

    def __init__(self, channels: int, pool: int) -> None:
        super().__init__()
        self.pool = pool
        self.pu_conv = conv(channels, channels, 1 if pool == 4 else 3)
        self.batch_normalization = nn.BatchNorm2d(channels, eps=1e-3)
        if pool == 4:
            self.conv_up_1 = nn.ConvTranspose2d(channels, channels, 2, 2)
        if pool > 1:
            self.conv_up = nn.ConvTranspose2d(channels, channels, 2, 2)

    def forward(self, x: Tensor) -> Tensor:
        """Pooled, convolved, normalised, enlarged."""
        if self.pool > 1:
            x = F.max_pool2d(x, self.pool)
        x = F.relu(self.batch_normalization(F.relu(self.pu_conv(x))))
        if self.pool == 4:
            x = F.relu(self.conv_up_1(x))
        return F.relu(self.conv_up(x)) if self.pool > 1 else x


class DenoiseNet(nn.Module):
    """R and I to the restored R."""

    def __init__(self) -> None:
        super().__init__()
        widths = [(3, 32, 64), (64, 128, 256), (256, 512, 256), (256, 128, 64)]
        for k, (inputs, middle, outputs) in enumerate(widths, 1):
            setattr(self, f"de_conv{k}_1", conv(inputs, middle))
            setattr(self, f"de_conv{k}_2", conv(middle, outputs))
            setattr(self, f"de_conv{k}", Guide())
            for pool in (1, 2, 4):
                setattr(self, f"de_conv{k}pu{pool}", Scale(outputs, pool))
            setattr(self, f"de_conv{k}multi_scale_feature", conv(4 * outputs, outputs, 1))
        self.de_conv5_1 = conv(64, 32)
        self.de_conv10 = conv(32, 3)

    def forward(self, x: Tensor, light: Tensor) -> Tensor:
        """The restored R."""
        for k in range(1, 5):
            x = lrelu(getattr(self, f"de_conv{k}_1")(x))
            x = lrelu(getattr(self, f"de_conv{k}_2")(x))
            x = x * getattr(self, f"de_conv{k}")(light)
            scales = [getattr(self, f"de_conv{k}pu{pool}")(x) for pool in (1, 2, 4)]
            x = F.relu(getattr(self, f"de_conv{k}multi_scale_feature")(torch.cat([x, *scales], 1)))
        return torch.sigmoid(self.de_conv10(lrelu(self.de_conv5_1(x))))


class Peer(nn.Module):
    """Stretch, decomposition, restoration and blend."""

    def __init__(self) -> None:
        super().__init__()
        self.DecomNet = DecomNet()
        self.Denoise_Net = DenoiseNet()

    def forward(self, batch: Tensor) -> Tensor:
        """Enhance (N, 3, H, W); no clamp."""
        height, width = batch.shape[-2:]
        low, high = batch.amin((1, 2, 3), keepdim=True), batch.amax((1, 2, 3), keepdim=True)
        x = (batch - low) / torch.clamp(high - low, min=0.001)
        x = F.pad(x, (0, -width % 4, 0, -height % 4), mode="reflect")
        return self.enhance(x)[..., :height, :width]

    def enhance(self, x: Tensor) -> Tensor:
        """Enhance stretched images whose sides are multiples of 4."""
        reflectance, light = self.DecomNet(x)
        restored = self.Denoise_Net(reflectance, light)
        dark = restored * self.lightness(reflectance)
        return light * x + (1 - light) * dark

    def lightness(self, reflectance: Tensor) -> Tensor:
        """min(sqrt(2 blurred grey), 1)."""
        red, green, blue = reflectance.split(1, dim=1)
        grey = 0.2125 * red + 0.7154 * green + 0.0721 * blue
        places = torch.arange(-12.0, 13.0)
        kernel = torch.exp(-(places**2) / 18)
        kernel = (kernel / kernel.sum()).to(grey)
        grey = F.pad(grey, (12, 12, 12, 12), mode="replicate")
        grey = F.conv2d(F.conv2d(grey, kernel.view(1, 1, 25, 1)), kernel.view(1, 1, 1, 25))
        return torch.sqrt(2 * grey).clamp(max=1)


def build() -> nn.Module:
    """The network in eval mode; its keys are a part of those of the plugin."""
    return Peer().eval()
