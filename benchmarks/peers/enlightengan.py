"""EnlightenGAN's generator written plainly, layer by layer, as a yardstick for speed and memory.

`build()` gives the network with the names of the official state dict (without `module.`).
"""

import torch
import torch.nn.functional as F
from torch import Tensor, nn

WIDTHS = (32, 64, 128, 256, 512)


class Network(nn.Module):
    """U-Net with an attention map."""

    def __init__(self) -> None:
        super().__init__()
        inputs = 4
        for level, width in enumerate(WIDTHS, start=1):
            self._add(level, 1, inputs, width)
            self._add(level, 2, width, width)
            inputs = width
        for level, width in zip(range(6, 10), WIDTHS[-2::-1], strict=True):
            setattr(self, f"deconv{level - 1}", nn.Conv2d(2 * width, width, 3, padding=1))
            self._add(level, 1, 2 * width, width)
            self._add(level, 2, width, width, norm=level < 9)
        self.conv10 = nn.Conv2d(32, 3, 1)
        self.pool = nn.MaxPool2d(2)
        self.act = nn.LeakyReLU(0.2, inplace=True)

    def _add(self, level: int, step: int, inputs: int, outputs: int, *, norm: bool = True) -> None:
        name = f"{level}_{step}"
        setattr(self, f"conv{name}", nn.Conv2d(inputs, outputs, 3, padding=1))
        if norm:
            setattr(self, f"bn{name}", nn.BatchNorm2d(outputs))

    def _block(self, name: str, x: Tensor) -> Tensor:
        return getattr(self, f"bn{name}")(self.act(getattr(self, f"conv{name}")(x)))

    def forward(self, batch: Tensor) -> Tensor:
        """(N, 3, H, W) in 0..1 to the enhanced image on the same scale."""
        image = (batch - 0.5) / 0.5
        red, green, blue = image[:, 0:1] + 1, image[:, 1:2] + 1, image[:, 2:3] + 1
        gray = 1.0 - (0.299 * red + 0.587 * green + 0.114 * blue) / 2.0
        wide = image.shape[3] > 2200
        if wide:
            image, gray = F.avg_pool2d(image, 2), F.avg_pool2d(gray, 2)
        height, width = image.shape[2:]
        rows, columns = -height % 16, -width % 16
        top, left = rows // 2, columns // 2
        pads = [left, columns - left, top, rows - top]
        image, gray = F.pad(image, pads, mode="reflect"), F.pad(gray, pads, mode="reflect")
        output = self._generate(image, gray)[..., top : top + height, left : left + width]
        if wide:
            output = F.interpolate(output, scale_factor=2, mode="bilinear")
        return (output + 1) / 2

    def _generate(self, image: Tensor, gray: Tensor) -> Tensor:
        grays = [gray]
        for _ in range(4):
            grays.append(self.pool(grays[-1]))
        x = torch.cat([image, gray], dim=1)
        skips = []
        for level in range(1, 5):
            x = self._block(f"{level}_2", self._block(f"{level}_1", x))
            skips.append(x)
            x = self.pool(x)
        x = self._block("5_1", x) * grays[4]
        x = self._block("5_2", x)
        for level in range(6, 10):
            x = F.interpolate(x, scale_factor=2, mode="bilinear", align_corners=False)
            skip = skips[9 - level] * grays[9 - level]
            x = torch.cat([getattr(self, f"deconv{level - 1}")(x), skip], dim=1)
            x = self._block(f"{level}_1", x)
            if level < 9:
                x = self._block(f"{level}_2", x)
        x = self.act(self.conv9_2(x))
        return self.conv10(x) * gray + image


def build() -> nn.Module:
    """The network in evaluation mode."""
    return Network().eval()
