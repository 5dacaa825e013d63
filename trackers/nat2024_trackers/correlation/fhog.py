"""Histograms of oriented gradients with 31 channels, for many patches of one size at once.

Source: Felzenszwalb, Girshick, McAllester, Ramanan, "Object Detection with Discriminatively Trained
Part-Based Models", PAMI 2010, section 6: of the colour channels the one with the strongest gradient
speaks; its direction falls into one of 18 bins, its place is shared bilinearly by four cells; each
cell is normalised by the energies of the four blocks of 2x2 cells that hold it, and cut at 0.2.

The outermost cells are kept, their missing neighbours repeated (the paper drops them).
"""

from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

Array: TypeAlias = npt.NDArray[np.float32]

DIRECTIONS = 18
"""Signed directions; half as many without sign."""

CHANNELS = 31
"""9 directions without sign, 18 with sign, 4 block energies."""

TRUNCATION = 0.2
TEXTURE_WEIGHT = 0.2357
"""Weight of the block energies, as the authors' code has it."""

EPSILON = 1e-4


_STRIP_PIXELS = 8192
"""Pixels that are worked on at once: intermediate results stay in the processor's cache."""


@dataclass(frozen=True, slots=True)
class FHOG:
    """The transform for patches of one size; what depends only on the size is computed once.

    Attributes:
        rows: cells from top to bottom.
        columns: cells from left to right.
        cell: side of a cell in pixels.
    """

    rows: int
    columns: int
    cell: int
    _places: npt.NDArray[np.intp] = field(init=False, repr=False, compare=False)
    _shares: tuple[npt.NDArray[np.float64], ...] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        top, lower = _shared_places(self.rows, self.cell)
        left, right = _shared_places(self.columns, self.cell)
        places = top[:, None] * (self.columns + 2) + left
        upper, first = 1 - lower, 1 - right
        shares = tuple(np.outer(y, x) for y in (upper, lower) for x in (first, right))
        object.__setattr__(self, "_places", places)
        object.__setattr__(self, "_shares", shares)

    def __call__(self, patches: Array) -> Array:
        """Features of patches.

        Args:
            patches: float32 (n, rows * cell, columns * cell, channels) in 0..255.

        Returns:
            float32 (n, 31, rows, columns): directions without sign, with sign, block energies.
        """
        total = np.zeros((len(patches), DIRECTIONS, self.rows + 2, self.columns + 2))
        row_pixels = len(patches) * self.columns * self.cell**2
        strip = max(1, _STRIP_PIXELS // row_pixels)
        for first in range(0, self.rows, strip):
            last = min(self.rows, first + strip)
            total[:, :, first : last + 2] += self._strip(patches, first, last)
        return normalise(total[..., 1:-1, 1:-1].astype(np.float32))

    def _strip(self, patches: Array, first: int, last: int) -> npt.NDArray[np.float64]:
        """Magnitudes of some rows of cells, shared among the four cells around each pixel.

        float64 (n, 18, last - first + 2, columns + 2): with a row and a column of cells around.
        """
        top, bottom = first * self.cell, last * self.cell
        above = min(top, 1)  # a pixel more on either side, for the differences
        magnitude, direction = strongest_gradients(patches[:, top - above : bottom + 1])
        inside = slice(above, above + bottom - top)
        magnitude, direction = magnitude[:, inside].astype(np.float64), direction[:, inside]
        width, pixels = self.columns + 2, slice(0, bottom - top)
        cells = (last - first + 2) * width
        maps = direction + DIRECTIONS * np.arange(len(patches))[:, None, None]
        places = (maps * cells + self._places[pixels]).ravel()
        length = len(patches) * DIRECTIONS * cells
        total = np.zeros(length)
        for offset, share in zip((0, 1, width, width + 1), self._shares, strict=True):
            weights = (magnitude * share[pixels]).ravel()
            total[offset:] += np.bincount(places, weights, length - offset)
        return total.reshape(len(patches), DIRECTIONS, -1, width)


def strongest_gradients(patches: Array) -> tuple[Array, npt.NDArray[np.intp]]:
    """Magnitude (n, H, W) and direction bin 0..17 of the colour channel with the larger gradient.

    Central differences; at the border the missing neighbour is the pixel itself. Of equal channels
    the first one speaks.
    """
    across, down = _differences(patches[..., 0])
    energy = across * across + down * down
    for channel in range(1, patches.shape[-1]):
        other_across, other_down = _differences(patches[..., channel])
        other_energy = other_across * other_across + other_down * other_down
        stronger = other_energy > energy
        energy = np.where(stronger, other_energy, energy)
        across = np.where(stronger, other_across, across)
        down = np.where(stronger, other_down, down)
    turns = np.arctan2(down, across) * np.float32(DIRECTIONS / (2 * np.pi))
    direction = np.rint(turns).astype(np.intp)
    direction += DIRECTIONS * (direction < 0)
    return np.sqrt(energy), direction


def _differences(planes: Array) -> tuple[Array, Array]:
    """Right minus left and lower minus upper neighbour of every pixel of (n, H, W)."""
    plane = np.ascontiguousarray(planes)
    across, down = np.empty_like(plane), np.empty_like(plane)
    np.subtract(plane[:, :, 2:], plane[:, :, :-2], out=across[:, :, 1:-1])
    np.subtract(plane[:, :, 1], plane[:, :, 0], out=across[:, :, 0])
    np.subtract(plane[:, :, -1], plane[:, :, -2], out=across[:, :, -1])
    np.subtract(plane[:, 2:], plane[:, :-2], out=down[:, 1:-1])
    np.subtract(plane[:, 1], plane[:, 0], out=down[:, 0])
    np.subtract(plane[:, -1], plane[:, -2], out=down[:, -1])
    return across, down


def normalise(histograms: Array) -> Array:
    """From histograms (n, 18, rows, columns) to the features (n, 31, rows, columns)."""
    half = DIRECTIONS // 2
    count, _, rows, columns = histograms.shape
    both = np.concatenate([histograms[:, :half] + histograms[:, half:], histograms], axis=1)
    features = np.empty((count, CHANNELS, rows, columns), dtype=np.float32)
    directions, energies = features[:, : half + DIRECTIONS], features[:, half + DIRECTIONS :]
    factors = _block_factors(both[:, :half])
    cut = np.empty_like(both)
    for block, (y, x) in enumerate(((0, 0), (0, 1), (1, 0), (1, 1))):
        np.multiply(both, factors[:, None, y : y + rows, x : x + columns], out=cut)
        np.minimum(cut, np.float32(TRUNCATION), out=cut)
        energies[:, block] = cut[:, half:].sum(axis=1)
        if block:
            directions += cut
        else:
            directions[...] = cut
    directions *= np.float32(0.5)
    energies *= np.float32(TEXTURE_WEIGHT)
    return features


def _block_factors(unsigned: Array) -> Array:
    """One over the norm of each block of 2x2 cells, (n, rows + 1, columns + 1)."""
    count, _, rows, columns = unsigned.shape
    energy = np.empty((count, rows + 2, columns + 2), dtype=np.float32)
    energy[:, 1:-1, 1:-1] = np.square(unsigned).sum(axis=1)
    energy[:, 0], energy[:, -1] = energy[:, 1], energy[:, -2]
    energy[:, :, 0], energy[:, :, -1] = energy[:, :, 1], energy[:, :, -2]
    pairs = energy[:, :-1] + energy[:, 1:]
    factors: Array = 1 / np.sqrt(pairs[:, :, :-1] + pairs[:, :, 1:] + np.float32(EPSILON))
    return factors


def _shared_places(cells: int, cell: int) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.float64]]:
    """For every pixel of an axis the cell before it, counted from 1, and the next one's share."""
    position = (np.arange(cells * cell) + 0.5) / cell + 0.5
    before = np.floor(position)
    return before.astype(np.intp), position - before
