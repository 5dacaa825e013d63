"""The network of RUAS (Liu et al., CVPR 2021), symbols as in the paper.

Three stages estimate the illumination t of an image y and divide it away, u = y / t; a denoiser
takes the noise off the last u. Both are made of searched cells, with 3 and with 6 channels.

Images are float32 (N, 3, H, W) of any size. Names of modules are those of the official state dict.
"""

from typing import cast

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from nat2024.networks.bands import run_in_bands

_STAGES = 3
_SLOPE = 0.05
_LEAST_LIGHT = 0.001
_FEATURES = 6
_STAGE_HALO = 3  # the largest of four sees 1 row, a cell 2
_DENOISE_HALO = 8  # stem and last convolution see 1 row each, three cells 2 each


class Convolution(nn.Module):
    """A searched convolution plus `added` times its input, computed as one convolution."""

    unit: Tensor

    def __init__(self, channels: int, kernel: int, *, dilation: int = 1, added: int = 0) -> None:
        super().__init__()
        padding = dilation * (kernel // 2)
        self.op = nn.Conv2d(channels, channels, kernel, padding=padding, dilation=dilation)
        unit = nn.init.dirac_(torch.empty_like(self.op.weight.detach()))
        self.register_buffer("unit", added * unit, persistent=False)

    def forward(self, x: Tensor) -> Tensor:
        """(N, channels, H, W) to the same."""
        weight = self.op.weight + self.unit
        return F.conv2d(x, weight, self.op.bias, 1, self.op.padding, self.op.dilation)


class Skip(nn.Module):
    """`times` the input."""

    def __init__(self, times: int) -> None:
        super().__init__()
        self.times = times

    def forward(self, x: Tensor) -> Tensor:
        """Any shape to the same."""
        return x if self.times == 1 else self.times * x


class Cell(nn.Module):
    """A searched cell: a chain of residual steps r1..r4 whose intermediate states d1..d3 are mixed.

    The residual of a step that is itself residual counts twice; `added` and `times` of the
    operations hold both.
    """

    c1_d: nn.Module
    c1_r: nn.Module
    c2_d: nn.Module
    c2_r: nn.Module
    c3_d: nn.Module
    c3_r: nn.Module
    c4: nn.Module

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.c5 = nn.Conv2d(4 * channels, channels, 1)

    def forward(self, x: Tensor) -> Tensor:
        """(N, channels, H, W) to the same."""
        d1 = _activate(self.c1_d(x))
        r1 = _activate(self.c1_r(x))
        d2 = _activate(self.c2_d(r1))
        r2 = _activate(self.c2_r(r1))
        d3 = _activate(self.c3_d(r2))
        r3 = _activate(self.c3_r(r2))
        r4 = _activate(self.c4(r3))
        return self.c5(torch.cat([d1, d2, d3, r4], dim=1))  # type: ignore[no-any-return]


def _activate(x: Tensor) -> Tensor:
    return F.leaky_relu(x, _SLOPE)


class EnhanceCell(Cell):
    """The cell that was found for illumination."""

    def __init__(self) -> None:
        super().__init__(3)
        self.c1_d = Skip(1)
        self.c1_r = Convolution(3, 1, added=2)
        self.c2_d = Convolution(3, 3, dilation=2, added=1)
        self.c2_r = Convolution(3, 3, added=1)
        self.c3_d = Convolution(3, 3)
        self.c3_r = Skip(2)
        self.c4 = Convolution(3, 3)


class DenoiseCell(Cell):
    """The cell that was found for noise."""

    def __init__(self) -> None:
        super().__init__(_FEATURES)
        self.c1_d = Convolution(_FEATURES, 1, added=1)
        self.c1_r = Convolution(_FEATURES, 1, added=2)
        self.c2_d = Convolution(_FEATURES, 3, dilation=2, added=1)
        self.c2_r = Skip(2)
        self.c3_d = Convolution(_FEATURES, 1, added=1)
        self.c3_r = Convolution(_FEATURES, 1, added=2)
        self.c4 = Skip(1)


class Stage(nn.Module):
    """One estimate of the illumination."""

    def __init__(self) -> None:
        super().__init__()
        self.cell = EnhanceCell()

    def forward(self, y: Tensor, u: Tensor | None = None) -> tuple[Tensor, Tensor]:
        """The image y and the last stage's u (None in the first) to the new u and its t."""
        guess = largest_of_four(y if u is None else u)
        if u is not None:
            guess = guess.sub(u - y, alpha=0.5)
        t = torch.sigmoid(self.cell(guess)).clamp(_LEAST_LIGHT, 1.0)
        return (y / t).clamp(0.0, 1.0), t

    def banded(self, y: Tensor, u: Tensor | None) -> Tensor:
        """Only the u of `forward`, computed band by band."""
        if u is None:
            return run_in_bands(lambda rows: self(rows)[0], y, halo=_STAGE_HALO)
        both = torch.cat([y, u], dim=1)
        return run_in_bands(lambda rows: self(*rows.chunk(2, dim=1))[0], both, halo=_STAGE_HALO)


def largest_of_four(image: Tensor) -> Tensor:
    """The largest of each pixel and those right of, below and diagonally below it, 0 outside."""
    padded = F.pad(image, (0, 1, 0, 1))
    rows = torch.maximum(padded[..., :-1, :], padded[..., 1:, :])
    return torch.maximum(rows[..., :-1], rows[..., 1:])


class EnhanceNet(nn.Module):
    """Three stages with weights of their own."""

    def __init__(self) -> None:
        super().__init__()
        self.iems = nn.ModuleList([Stage() for _ in range(_STAGES)])

    def forward(self, y: Tensor) -> Tensor:
        """(N, 3, H, W) to u_3, 0..1."""
        u = None
        for stage in self.iems:
            u = cast("Stage", stage).banded(y, u)
        assert u is not None
        return u

    def maps(self, y: Tensor) -> dict[str, Tensor]:
        """`u1`, `t1` and so on of every stage."""
        found: dict[str, Tensor] = {}
        u = None
        for number, stage in enumerate(self.iems, start=1):
            u, t = stage(y, u)
            found |= {f"u{number}": u, f"t{number}": t}
        return found


class DenoiseNet(nn.Module):
    """Estimates the noise."""

    def __init__(self) -> None:
        super().__init__()
        self.stem = nn.Conv2d(3, _FEATURES, 3, padding=1)
        self.nrms = nn.ModuleList([DenoiseCell() for _ in range(3)])
        self.activate = nn.Sequential(nn.Conv2d(_FEATURES, 3, 3, padding=1))

    def forward(self, u: Tensor) -> Tensor:
        """(N, 3, H, W) to the same without its noise, not limited to 0..1."""
        return u - run_in_bands(self._noise, u, halo=_DENOISE_HALO)

    def _noise(self, u: Tensor) -> Tensor:
        features = self.stem(u)
        for cell in self.nrms:
            features = cell(features)
        return self.activate(features)  # type: ignore[no-any-return]


class RUASNet(nn.Module):
    """RUAS for images of any size.

    Args:
        denoise: whether `forward` gives the denoised image instead of u_3.
    """

    def __init__(self, *, denoise: bool = False) -> None:
        super().__init__()
        self.enhance_net = EnhanceNet()
        self.denoise_net = DenoiseNet()
        self.denoise = denoise

    def forward(self, image: Tensor) -> Tensor:
        """(N, 3, H, W) in 0..1 to u_3, 0..1, or to the denoised image, not limited."""
        u = self.enhance_net(image)
        return self.denoise_net(u) if self.denoise else u  # type: ignore[no-any-return]

    def maps(self, image: Tensor) -> dict[str, Tensor]:
        """`u1`..`u3`, `t1`..`t3` and `denoised`, each (N, 3, H, W)."""
        found = self.enhance_net.maps(image)
        return {**found, "denoised": self.denoise_net(found["u3"])}
