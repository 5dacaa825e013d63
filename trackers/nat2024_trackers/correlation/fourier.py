"""Discrete Fourier transforms of real maps in float32, the labels, and peaks between the cells.

Half spectra are complex64 (n, rows, columns // 2 + 1), the layout of `numpy.fft.rfft2`; OpenCV
computes them, since numpy's transform is several times slower on stacks of small maps.
"""

import math
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from nat2024_trackers.correlation.fhog import Array

Spectrum: TypeAlias = npt.NDArray[np.complex64]
"""Half spectra; see above."""

NEWTON_STEPS = 5


def fast_size(at_least: int) -> int:
    """The smallest even number from `at_least` that has no prime factor above 5."""
    size = max(2, at_least + at_least % 2)
    while _rest(size) > 1:
        size += 2
    return size


def _rest(number: int) -> int:
    for prime in (2, 3, 5):
        while number % prime == 0:
            number //= prime
    return number


def transform(maps: Array) -> Spectrum:
    """Half spectra of float32 (n, rows, columns)."""
    import cv2

    count, rows, columns = maps.shape
    half = columns // 2 + 1
    result = np.empty((count, rows, half), dtype=np.complex64)
    for index, one in enumerate(maps):
        full = cv2.dft(np.ascontiguousarray(one), flags=cv2.DFT_COMPLEX_OUTPUT)
        result[index] = full.view(np.complex64)[:, :half, 0]
    return result


def inverse(spectrum: Spectrum, columns: int) -> Array:
    """The real map float32 (rows, columns) of one half spectrum (rows, columns // 2 + 1)."""
    answer: Array = np.fft.irfft2(spectrum, s=(spectrum.shape[0], columns)).astype(np.float32)
    return answer


def gaussian_label(rows: int, columns: int, sigma: float) -> Array:
    """Gaussian with its peak of 1 at cell (0, 0), wrapped around; `sigma` in cells."""
    y, x = (np.fft.fftfreq(n, 1 / n) for n in (rows, columns))
    distance = y[:, None] ** 2 + x[None, :] ** 2
    return np.exp(-0.5 * distance / sigma**2).astype(np.float32)


def peak(spectrum: Spectrum, response: Array) -> tuple[float, float, float]:
    """Where the response is largest, between the cells as well: (down, right, height).

    The response is the trigonometric polynomial of its spectrum; Newton's method climbs from the
    largest cell and may not leave the cell's neighbourhood.

    Args:
        spectrum: half spectrum of the response.
        response: float32 (rows, columns).

    Returns:
        Offset in cells from (0, 0), in -n/2..n/2 on each axis, and the value there.
    """
    rows, columns = response.shape
    row, column = divmod(int(np.argmax(response)), columns)
    start = np.array([row, column], dtype=np.float64)
    polynomial = _Polynomial(spectrum, columns)
    place, height = start, float(response[row, column])
    for _ in range(NEWTON_STEPS):
        _, slope, bend = polynomial(place)
        if not (bend[0, 0] < 0 and np.linalg.det(bend) > 0):
            break
        place = place - np.linalg.solve(bend, slope)
        if np.abs(place - start).max() > 1:
            break
    else:
        height, start = polynomial(place)[0], place
    half = np.array([rows, columns]) / 2
    down, right = (start + half) % (rows, columns) - half
    return float(down), float(right), height


class _Polynomial:
    """Value, gradient and second derivatives of a real map between its cells."""

    def __init__(self, spectrum: Spectrum, columns: int) -> None:
        rows, half = spectrum.shape
        self._rows = 2j * math.pi * np.fft.fftfreq(rows)
        self._columns = 2j * math.pi * np.arange(half) / columns
        twice = np.full(half, 2.0)
        twice[0] = 1
        if columns % 2 == 0:
            twice[-1] = 1
        self._spectrum = spectrum * (twice / (rows * columns))

    def __call__(
        self, place: npt.NDArray[np.float64]
    ) -> tuple[float, npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        y, x = self._rows, self._columns
        across = np.exp(x * place[1]) * np.stack([np.ones_like(x), x, x * x])
        down = np.exp(y * place[0]) * np.stack([np.ones_like(y), y, y * y])
        table = (down @ self._spectrum @ across.T).real
        slope = np.array([table[1, 0], table[0, 1]])
        bend = np.array([[table[2, 0], table[1, 1]], [table[1, 1], table[0, 2]]])
        return float(table[0, 0]), slope, bend
