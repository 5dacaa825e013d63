"""The one-dimensional filter that tells how much larger or smaller the target has become.

Source: Danelljan, Häger, Khan, Felsberg, "Discriminative Scale Space Tracking", PAMI 2017: patches
of the target at 17 scales, each a column of features; a correlation filter along the scales; its
response is interpolated to 33 scales.
"""

import numpy as np
import numpy.typing as npt

from nat2024.types import Floats
from nat2024_trackers.correlation.fhog import FHOG, Array
from nat2024_trackers.correlation.fourier import Spectrum
from nat2024_trackers.correlation.samples import Pixels, cut_all

SCALES = 17
FINE_SCALES = 2 * SCALES - 1
STEP = 1.02
"""Ratio of neighbouring fine scales."""

MODEL_AREA = 512
"""Samples in the patch of one scale, about."""

CELL = 4
SIGMA = 1 / 16
"""Width of the label, as a share of the fine scales."""

REGULARISATION = 0.01
LEARNING_RATE = 0.025

_STEPS = np.arange(SCALES) - SCALES // 2
_EXPONENTS = _STEPS * (FINE_SCALES / SCALES)
_WEIGHTS = np.hanning(SCALES + 2)[1:-1]


class ScaleFilter:
    """A filter of one target, learned frame by frame.

    The authors compress the features by a QR decomposition that loses nothing; here the whole
    features are used, with the same responses.
    """

    def __init__(self, size: tuple[float, float]) -> None:
        """Start empty for a target whose width and height have the ratio of `size`."""
        shrink = np.sqrt(MODEL_AREA / (size[0] * size[1])) / CELL
        # Beyond 1 to 32 a patch would have less than a cell in a row.
        columns, rows = (int(np.clip(round(side * shrink), 2, 32)) for side in size)
        self._hog = FHOG(rows, columns, CELL)
        self._size = columns * CELL, rows * CELL
        frequencies = np.arange(SCALES // 2 + 1)
        turns = np.outer(_STEPS, frequencies) / SCALES
        self._forward = (_WEIGHTS[:, None] * np.exp(-2j * np.pi * turns)).astype(np.complex64)
        label = np.exp(-0.5 * (_EXPONENTS / (FINE_SCALES * SIGMA)) ** 2)
        self._label = (label @ np.exp(-2j * np.pi * turns)).astype(np.complex64)
        self._exponents = np.arange(FINE_SCALES) - FINE_SCALES // 2
        fine = np.outer(frequencies, self._exponents) / FINE_SCALES
        self._backward = np.where(frequencies > 0, 2, 1)[:, None] * np.exp(2j * np.pi * fine)
        self._numerator: Spectrum | None = None
        self._energy: Array = np.zeros(len(frequencies), dtype=np.float32)

    def learn(self, patch: Pixels, center: tuple[float, float], size: tuple[float, float]) -> None:
        """Take in the target as it looks now: `center` and `size` in pixels of the patch."""
        spectrum = self._spectrum(patch, center, size)
        numerator = self._label * np.conj(spectrum)
        energy = np.square(np.abs(spectrum)).sum(axis=0)
        if self._numerator is None:
            self._numerator, self._energy = numerator, energy
            return
        rate = np.float32(LEARNING_RATE)
        self._numerator += rate * (numerator - self._numerator)
        self._energy += rate * (energy - self._energy)

    def factor(
        self, patch: Pixels, center: tuple[float, float], size: tuple[float, float]
    ) -> float:
        """How many times larger than `size` the target appears at `center`."""
        response = self.response(self._spectrum(patch, center, size))
        return float(STEP ** self._exponents[int(np.argmax(response))])

    def response(self, spectrum: Spectrum) -> Floats:
        """The filter's answer at the fine scales, float64 (33,)."""
        if self._numerator is None:
            return np.zeros(FINE_SCALES)
        answer = (self._numerator * spectrum).sum(axis=0) / (self._energy + REGULARISATION)
        fine: Floats = (answer @ self._backward).real / SCALES
        return fine

    def _spectrum(
        self, patch: Pixels, center: tuple[float, float], size: tuple[float, float]
    ) -> npt.NDArray[np.complex64]:
        """Transform along the scales, complex64 (features, 9)."""
        extents = np.outer(STEP**_EXPONENTS, size)
        looks = cut_all(patch, center, extents, self._size).astype(np.float32, copy=False)
        features = self._hog(looks).reshape(SCALES, -1)
        spectrum: npt.NDArray[np.complex64] = features.T @ self._forward
        return spectrum
