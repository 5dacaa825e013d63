"""RUAS written plainly, layer by layer, as a yardstick for speed and memory.

`build()` gives the network with the names of the official state dict; its answer is u_3, or the
denoised image with `denoise=True`.
"""

import torch
import torch.nn.functional as F
from torch import Tensor, nn


class Operation(nn.Module):
    """One searched operation; `residual` adds its input."""

    def __init__(self, channels: int, kernel: int, dilation: int = 1, *, residual: bool) -> None:
        super().__init__()
        padding = dilation * (kernel // 2)
        self.op = nn.Conv2d(channels, channels, kernel, padding=padding, dilation=dilation)
        self.residual = residual

    def forward(self, x: Tensor) -> Tensor:
        """Keeps the shape."""
        return self.op(x) + x if self.residual else self.op(x)


class Cell(nn.Module):
    """A searched cell from its seven operations."""

    def __init__(self, channels: int, operations: dict[str, nn.Module]) -> None:
        super().__init__()
        for name, operation in operations.items():
            setattr(self, name, operation)
        self.c5 = nn.Conv2d(4 * channels, channels, 1)
        self.act = nn.LeakyReLU(0.05)

    def forward(self, x: Tensor) -> Tensor:
        """Keeps the shape."""
        d1 = self.act(self.c1_d(x))
        r1 = self.act(self.c1_r(x) + x)
        d2 = self.act(self.c2_d(r1))
        r2 = self.act(self.c2_r(r1) + r1)
        d3 = self.act(self.c3_d(r2))
        r3 = self.act(self.c3_r(r2) + r2)
        r4 = self.act(self.c4(r3))
        return self.c5(torch.cat([d1, d2, d3, r4], dim=1))


def enhance_cell() -> Cell:
    """The cell of 3 channels."""
    operations = {
        "c1_d": nn.Identity(),
        "c1_r": Operation(3, 1, residual=True),
        "c2_d": Operation(3, 3, 2, residual=True),
        "c2_r": Operation(3, 3, residual=False),
        "c3_d": Operation(3, 3, residual=False),
        "c3_r": nn.Identity(),
        "c4": Operation(3, 3, residual=False),
    }
    return Cell(3, operations)


def denoise_cell() -> Cell:
    """The cell of 6 channels."""
    operations = {
        "c1_d": Operation(6, 1, residual=True),
        "c1_r": Operation(6, 1, residual=True),
        "c2_d": Operation(6, 3, 2, residual=True),
        "c2_r": nn.Identity(),
        "c3_d": Operation(6, 1, residual=True),
        "c3_r": Operation(6, 1, residual=True),
        "c4": nn.Identity(),
    }
    return Cell(6, operations)


class Stage(nn.Module):
    """One stage of illumination estimation."""

    def __init__(self) -> None:
        super().__init__()
        self.cell = enhance_cell()

    def forward(self, y: Tensor, u: Tensor, k: int) -> Tensor:
        """Input y and the last estimate u to the next estimate."""
        right = F.pad(u, (0, 1, 0, 1))
        largest = torch.max(
            torch.max(right[..., :-1, :-1], right[..., 1:, :-1]),
            torch.max(right[..., :-1, 1:], right[..., 1:, 1:]),
        )
        t_hat = largest if k == 0 else largest - 0.5 * (u - y)
        t = torch.clamp(torch.sigmoid(self.cell(t_hat)), 0.001, 1.0)
        return torch.clamp(y / t, 0.0, 1.0)


class Enhance(nn.Module):
    """Three stages."""

    def __init__(self) -> None:
        super().__init__()
        self.iems = nn.ModuleList([Stage() for _ in range(3)])

    def forward(self, y: Tensor) -> Tensor:
        """The image y to u_3."""
        u = y
        for k, stage in enumerate(self.iems):
            u = stage(y, u, k)
        return u


class Denoise(nn.Module):
    """Three cells that estimate noise."""

    def __init__(self) -> None:
        super().__init__()
        self.stem = nn.Conv2d(3, 6, 3, padding=1)
        self.nrms = nn.ModuleList([denoise_cell() for _ in range(3)])
        self.activate = nn.Sequential(nn.Conv2d(6, 3, 3, padding=1))

    def forward(self, u: Tensor) -> Tensor:
        """u_3 without its noise."""
        features = self.stem(u)
        for cell in self.nrms:
            features = cell(features)
        return u - self.activate(features)


class Network(nn.Module):
    """Enhancement, and denoising where it is wanted."""

    def __init__(self, *, denoise: bool) -> None:
        super().__init__()
        self.enhance_net = Enhance()
        self.denoise_net = Denoise()
        self.denoise = denoise

    def forward(self, batch: Tensor) -> Tensor:
        """(N, 3, H, W) in 0..1 to the enhanced image."""
        u = self.enhance_net(batch)
        return self.denoise_net(u) if self.denoise else u


def build(*, denoise: bool = False) -> nn.Module:
    """The network in evaluation mode."""
    return Network(denoise=denoise).eval()
