"""A multigrid cycle for systems on an image whose coefficients jump from pixel to pixel.

Interpolation follows the coefficients (black box multigrid; Dendy, Journal of Computational
Physics 1982 and 1983), so that nothing leaks over the edges of an image; the coarse systems are
those that the interpolation implies. One cycle serves as preconditioner of a Krylov method.

A stencil is a tensor (3, 3, H, W): entry (1 + dy, 1 + dx, y, x) is the coefficient that the row of
pixel (y, x) has at (y + dy, x + dx). Links over the border are 0.
"""

import math

import torch
import torch.nn.functional as F
from torch import Tensor

_SMALLEST = 24  # sides at which the system is solved densely
# Damping of the smoothing steps: Chebyshev's for the upper 90 % of the spectrum of D^-1 A, 0..2.
_DAMPINGS = tuple(1 / (1.1 + 0.9 * math.cos(math.pi * (2 * step - 1) / 6)) for step in (1, 2, 3))
_OFFSETS = [(dy, dx) for dy in (-1, 0, 1) for dx in (-1, 0, 1)]


def apply_stencil(stencil: Tensor, t: Tensor, points: int = 9) -> Tensor:
    """The left-hand side for `t` (..., H, W); 5 points leave out the corners of the stencil."""
    height, width = t.shape[-2:]
    padded = F.pad(t, (1, 1, 1, 1))
    answer = stencil[1, 1] * t
    for dy, dx in _OFFSETS:
        if (dy, dx) == (0, 0) or (points == 5 and dy and dx):
            continue
        shifted = padded[..., 1 + dy : 1 + dy + height, 1 + dx : 1 + dx + width]
        answer.addcmul_(stencil[1 + dy, 1 + dx], shifted)
    return answer


class _Interpolation:
    """From every second pixel of every second row to all pixels, and its transpose."""

    def __init__(self, stencil: Tensor) -> None:
        self.shape = stencil.shape[2:]
        odd, even = slice(1, None, 2), slice(0, None, 2)
        rows = stencil[:, :, even, odd]
        centre = -rows[:, 1].sum(0)
        self.left, self.right = rows[:, 0].sum(0) / centre, rows[:, 2].sum(0) / centre
        columns = stencil[:, :, odd, even]
        centre = -columns[1].sum(0)
        self.up, self.down = columns[0].sum(0) / centre, columns[2].sum(0) / centre
        middle = stencil[:, :, odd, odd]
        self.around = middle / -middle[1, 1]

    def __call__(self, coarse: Tensor) -> Tensor:
        """(H / 2, W / 2), rounded up, to (H, W)."""
        fine = coarse.new_zeros(self.shape)
        height, width = self.shape
        fine[0::2, 0::2] = coarse
        columns, rows = width // 2, height // 2
        right = F.pad(coarse, (0, 1))[:, 1 : columns + 1]
        fine[0::2, 1::2] = self.left * coarse[:, :columns] + self.right * right
        below = F.pad(coarse, (0, 0, 0, 1))[1 : rows + 1]
        fine[1::2, 0::2] = self.up * coarse[:rows] + self.down * below
        padded = F.pad(fine, (0, 1, 0, 1))
        middle = fine[1::2, 1::2]
        for dy, dx in _OFFSETS:
            if dy or dx:
                part = padded[1 + dy : height + dy : 2, 1 + dx : width + dx : 2]
                middle += self.around[1 + dy, 1 + dx] * part
        return fine

    def transposed(self, fine: Tensor) -> Tensor:
        """(H, W) to (H / 2, W / 2), rounded up."""
        height, width = self.shape
        columns, rows = width // 2, height // 2
        padded = F.pad(fine, (0, 1, 0, 1))
        middle = fine[1::2, 1::2]
        for dy, dx in _OFFSETS:
            if dy or dx:
                part = padded[1 + dy : height + dy : 2, 1 + dx : width + dx : 2]
                part += self.around[1 + dy, 1 + dx] * middle
        coarse = F.pad(padded[0:height:2, 0:width:2], (0, 1, 0, 1))
        beside, below = padded[0:height:2, 1:width:2], padded[1:height:2, 0:width:2]
        coarse[:-1, :columns] += self.left * beside
        coarse[:-1, 1 : columns + 1] += self.right * beside
        coarse[:rows, :-1] += self.up * below
        coarse[1 : rows + 1, :-1] += self.down * below
        return coarse[:-1, :-1].contiguous()


class Multigrid:
    """One V-cycle, a symmetric approximate inverse of a symmetric system.

    Args:
        stencil: (3, 3, H, W), a symmetric M-matrix with five-point links.
    """

    def __init__(self, stencil: Tensor) -> None:
        self._levels: list[tuple[Tensor, int, Tensor, _Interpolation]] = []
        points = 5
        while max(stencil.shape[2:]) > _SMALLEST:
            interpolate = _Interpolation(stencil)
            self._levels.append((stencil, points, stencil[1, 1].reciprocal(), interpolate))
            stencil, points = _coarsen(stencil, points, interpolate), 9
        self._inverse = torch.linalg.inv(_dense(stencil).double()).to(stencil.dtype)

    def __call__(self, residual: Tensor) -> Tensor:
        """An approximate solution for the right-hand side `residual` (H, W)."""
        return self._cycle(0, residual)

    def _cycle(self, level: int, target: Tensor) -> Tensor:
        if level == len(self._levels):
            solved: Tensor = self._inverse @ target.flatten()
            return solved.view_as(target)
        stencil, points, inverse, interpolate = self._levels[level]
        first, *others = _DAMPINGS
        t = inverse * target * first
        for damping in others:
            t.addcmul_(inverse, target - apply_stencil(stencil, t, points), value=damping)
        rest = interpolate.transposed(target - apply_stencil(stencil, t, points))
        t += interpolate(self._cycle(level + 1, rest))
        for damping in reversed(_DAMPINGS):
            t.addcmul_(inverse, target - apply_stencil(stencil, t, points), value=damping)
        return t


def _coarsen(stencil: Tensor, points: int, interpolate: _Interpolation) -> Tensor:
    """The coarse matrix P'AP, read off its products with nine patterns of every third pixel."""
    height, width = ((size + 1) // 2 for size in stencil.shape[2:])
    coarse = stencil.new_zeros(3, 3, height, width)
    y, x = torch.arange(height) % 3, torch.arange(width) % 3
    for row in range(3):
        for column in range(3):
            pattern = ((y == row)[:, None] & (x == column)).to(stencil.dtype)
            product = apply_stencil(stencil, interpolate(pattern), points)
            product = interpolate.transposed(product)
            for dy, dx in _OFFSETS:
                places = slice((row - dy) % 3, None, 3), slice((column - dx) % 3, None, 3)
                coarse[1 + dy, 1 + dx][places] = product[places]
    coarse[0, :, 0] = coarse[2, :, -1] = 0
    coarse[:, 0, :, 0] = coarse[:, 2, :, -1] = 0
    return coarse


def _dense(stencil: Tensor) -> Tensor:
    height, width = stencil.shape[2:]
    unit = torch.eye(height * width, dtype=stencil.dtype).view(-1, height, width)
    return apply_stencil(stencil, unit).flatten(1).T
