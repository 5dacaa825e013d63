"""Winograd convolution: a convolution with fewer multiplications than its sum has.

Lavin and Gray, CVPR 2016: a tile of (m + r - 1)^2 inputs is transformed, multiplied point by point
with the transformed weights of an r x r kernel, and transformed back to m^2 outputs. For 4 x 4
outputs that is 36 products instead of 144 of a 3 x 3 kernel, and 64 instead of 400 of a 5 x 5
kernel. All three steps are products of matrices here, which a processor does best; they pay where
there are many channels, since the transforms grow with the channels and the products with their
square.

Results are those of the plain sum but for rounding: within 3e-6 of the largest output for 3 x 3
kernels, where the plain sum in float32 is no nearer, and within 1e-5 for 5 x 5.
"""

from collections.abc import Iterator, Sequence
from fractions import Fraction
from functools import cache
from itertools import pairwise
from typing import NamedTuple, TypeAlias

import torch
from torch import Tensor

OUTPUTS = 4
"""Side of a tile of outputs."""

# Where polynomials are evaluated. Of all small fractions these lose least to rounding.
_POINTS = {
    3: ("0", "5/8", "-5/8", "3/2", "-3/2"),
    5: ("0", "1/2", "-1/2", "1", "-1", "2", "-2"),
}

_TILES = 128
"""Tiles that are transformed together: what they need stays near the processor."""

_Matrix: TypeAlias = list[list[Fraction]]


class Transforms(NamedTuple):
    """Matrices of one dimension, float64: outputs = A^T ((G weights) * (B^T inputs))."""

    outputs: Tensor
    """A^T, (m, m + r - 1)."""

    weights: Tensor
    """G, (m + r - 1, r)."""

    inputs: Tensor
    """B^T, (m + r - 1, m + r - 1)."""


@cache
def transforms(kernel: int) -> Transforms:
    """The matrices for kernels of 3 or 5 taps and `OUTPUTS` outputs (Toom-Cook interpolation).

    Outputs of a convolution are coefficients of a product of polynomials, known from its values at
    as many points as it has coefficients; the last point is infinity.
    """
    points = [Fraction(point) for point in _POINTS[kernel]]
    others = [[other for other in points if other != point] for point in points]
    ends = [Fraction(0)] * len(points)
    outputs = [[point**power for point in points] for power in range(OUTPUTS)]
    weights = [
        [point**power / _product(point - other for other in rest) for power in range(kernel)]
        for point, rest in zip(points, others, strict=True)
    ]
    inputs = [[*_polynomial(rest), Fraction(0)] for rest in others]
    return Transforms(
        _tensor([[*row, Fraction(power == OUTPUTS - 1)] for power, row in enumerate(outputs)]),
        _tensor([*weights, [*ends[: kernel - 1], Fraction(1)]]),
        _tensor([*inputs, _polynomial(points)]),
    )


def _product(factors: Iterator[Fraction]) -> Fraction:
    found = Fraction(1)
    for factor in factors:
        found *= factor
    return found


def _polynomial(roots: Sequence[Fraction]) -> list[Fraction]:
    """Coefficients of the polynomial with these roots, lowest power first."""
    found = [Fraction(1)]
    for root in roots:
        found = [low - root * high for low, high in pairwise([Fraction(0), *found, Fraction(0)])]
    return found


def _tensor(matrix: _Matrix) -> Tensor:
    rows = [[float(value) for value in row] for row in matrix]
    return torch.tensor(rows, dtype=torch.float64)


class WinogradConvolution:
    """A convolution with stride 1 of a 3 x 3 or 5 x 5 kernel, for inference in float32 on a CPU."""

    def __init__(self, weight: Tensor, bias: Tensor | None) -> None:
        """Transform the weights.

        Args:
            weight: (channels out, channels in, r, r), r 3 or 5.
            bias: (channels out,).
        """
        self.channels_out, self.channels_in, self.kernel, _ = weight.shape
        matrices = transforms(self.kernel)
        self._side = OUTPUTS + self.kernel - 1
        # Both dimensions at once: the product of a tile and its transposed is one matrix then.
        self._inputs = torch.kron(matrices.inputs, matrices.inputs).float()
        self._outputs = torch.kron(matrices.outputs, matrices.outputs).float()
        g = matrices.weights
        turned = torch.einsum("ar,bs,oirs->abio", g, g, weight.detach().double())
        self._weights = turned.flatten(0, 1).float().contiguous()
        self._bias = weight.new_zeros(self.channels_out) if bias is None else bias.detach()

    def __call__(self, maps: Tensor, padding: int = 0) -> Tensor:
        """What `F.conv2d` gives for maps (n, channels in, h, w), channels-last.

        Args:
            maps: of any memory layout.
            padding: zeros on each side.
        """
        count, _, height, width = maps.shape
        high, wide = (one + 2 * padding - self.kernel + 1 for one in (height, width))
        down, across = -(-high // OUTPUTS), -(-wide // OUTPUTS)
        padded = _padded(maps, padding, down * OUTPUTS, across * OUTPUTS, self.kernel - 1)
        found = maps.new_empty((count, down, OUTPUTS, across, OUTPUTS, self.channels_out))
        for images, rows in _bands(count, down, across):
            self._fill(found[images, rows], padded[images, rows.start * OUTPUTS :])
        whole = found.view(count, down * OUTPUTS, across * OUTPUTS, -1)[:, :high, :wide]
        return whole.contiguous().permute(0, 3, 1, 2)

    def _fill(self, found: Tensor, padded: Tensor) -> None:
        """Fill (images, rows, 4, across, 4, channels out) from padded images that begin there."""
        side, channels = self._side, self.channels_in
        images, rows, _, across, _, _ = found.shape
        of_image, of_row, of_pixel, _ = padded.stride()
        tiles = padded.as_strided(
            (side, side, images, rows, across, channels),
            (of_row, of_pixel, of_image, OUTPUTS * of_row, OUTPUTS * of_pixel, 1),
        )
        count = images * rows * across
        turned = self._inputs @ tiles.reshape(side * side, count * channels)
        products = torch.bmm(turned.view(side * side, count, channels), self._weights)
        answers = self._outputs @ products.view(side * side, -1)
        answers = answers.view(OUTPUTS, OUTPUTS, images, rows, across, self.channels_out)
        torch.add(answers.permute(2, 3, 0, 4, 1, 5), self._bias, out=found)


def _padded(maps: Tensor, before: int, high: int, wide: int, more: int) -> Tensor:
    """(n, high + more, wide + more, channels): the maps among zeros, after `before` of them."""
    count, channels, height, width = maps.shape
    padded = maps.new_zeros((count, high + more, wide + more, channels))
    padded[:, before : before + height, before : before + width] = maps.permute(0, 2, 3, 1)
    return padded


def _bands(count: int, down: int, across: int) -> Iterator[tuple[slice, slice]]:
    """Images and rows of tiles that are computed together."""
    images = max(_TILES // (down * across), 1)
    parts = -(-down // max(_TILES // across, 1))
    rows = -(-down // parts)  # of equal height
    for first in range(0, count, images):
        for top in range(0, down, rows):
            yield slice(first, min(first + images, count)), slice(top, min(top + rows, down))
