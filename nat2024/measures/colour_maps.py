"""Pure error of a function of colour: what varies among pixels of exactly one colour."""

import numpy as np
import numpy.typing as npt

from nat2024.types import Floats

Colours = npt.NDArray[np.int64]

LEAST_PIXELS = 1000
"""With fewer pixels of repeated colours, nothing is said."""


class ColourMap:
    """Counts, means and squared deviations of an enhancer's residuals for every colour seen.

    Residuals are those of any function of colour, such as a tone curve: what is subtracted is the
    same for all pixels of one colour.
    """

    def __init__(self) -> None:
        self.colours: Colours = np.empty(0, dtype=np.int64)
        self._images: Floats = np.empty(0)
        self._count: Floats = np.empty(0)
        self._mean: Floats = np.empty((0, 3))
        self._squares: Floats = np.empty(0)
        self._energy: Floats = np.empty(0)

    def add(self, colours: Colours, residual: Floats, energy: Floats) -> None:
        """Take the pixels of one image.

        Args:
            colours: int64 (H, W) of `pack_colours`.
            residual: float64 (H, W, 3).
            energy: float64 (H, W), squared effect of each pixel.
        """
        found, place = np.unique(colours.ravel(), return_inverse=True)
        flat = residual.reshape(-1, 3)
        new = ColourMap()
        new.colours = found
        new._images = np.ones(len(found))
        new._count = np.bincount(place).astype(np.float64)
        sums = [np.bincount(place, flat[:, channel]) for channel in range(3)]
        new._mean = np.stack(sums, axis=1) / new._count[:, None]
        apart = np.sum((flat - new._mean[place]) ** 2, axis=1)
        new._squares = np.bincount(place, apart).astype(np.float64)
        new._energy = np.bincount(place, energy.ravel()).astype(np.float64)
        self.merge(new)

    def merge(self, other: "ColourMap") -> None:
        """Add the pixels of other images."""
        both = np.concatenate([self.colours, other.colours])
        found, place = np.unique(both, return_inverse=True)

        def total(first: Floats, second: Floats) -> Floats:
            values = np.concatenate([first, second])
            return np.bincount(place, values, len(found)).astype(np.float64)

        count = total(self._count, other._count)
        means = np.concatenate([self._mean, other._mean])
        counts = np.concatenate([self._count, other._count])
        sums = [np.bincount(place, counts * means[:, c], len(found)) for c in range(3)]
        mean = np.stack(sums, axis=1) / count[:, None]
        apart = counts * np.sum((means - mean[place]) ** 2, axis=1)
        self._squares = total(self._squares, other._squares) + np.bincount(place, apart, len(found))
        self._images = total(self._images, other._images)
        self._energy = total(self._energy, other._energy)
        self.colours, self._count, self._mean = found, count, mean

    def pure_error(self, images: int = 1) -> tuple[float, float]:
        """Squared error that no function of colour explains, and the energy of the same pixels.

        Over colours of two pixels or more that occur in at least `images` images; (0, 0) where
        these are fewer than `LEAST_PIXELS` pixels.
        """
        use = (self._count >= 2) & (self._images >= images)
        count = self._count[use]
        if count.sum() < LEAST_PIXELS:
            return 0.0, 0.0
        error = float(np.sum(self._squares[use] * count / (count - 1)))
        return error, float(self._energy[use].sum())


def pack_colours(values: Floats) -> Colours:
    """One number for each colour of float64 (H, W, 3) in 0..1, rounded to 8 bits a channel."""
    levels = np.rint(values * 255).astype(np.int64)
    packed: Colours = (levels[..., 0] << 16) | (levels[..., 1] << 8) | levels[..., 2]
    return packed
