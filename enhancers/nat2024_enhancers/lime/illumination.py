"""The first guess of the illumination, and how strongly LIME smooths it at every place.

Maps are float64 (H, W). The smoothness between a pixel and its right (lower) neighbour is weighted
by W_x (W_y); the sped-up solver replaces |dT| by dT^2 / |dT_init| and so has the weights
w_d = W_d / |dT_init|.
"""

from typing import NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

Map = npt.NDArray[np.float64]

OFFSET = 0.02
"""What the variant "texture" adds to the first guess."""

_SHARPNESS = 0.02
_CORRELATION = np.array([[-1.0, 0.0, 1.0]])


class Smoothness(NamedTuple):
    """W_x and W_y, and w_x and w_y, float64 (H, W) each."""

    strength_x: Map
    strength_y: Map
    weight_x: Map
    weight_y: Map


def guess_illumination(image: Map, offset: float = 0.0) -> Map:
    """The largest channel of (3, H, W) at each pixel; what is no number counts as black."""
    largest: Map = np.nan_to_num(image.max(axis=0), nan=0.0, posinf=1.0, neginf=0.0)
    return largest + offset


def smoothness_by_texture(guess: Map, sigma: float, eps: float) -> Smoothness:
    """W_d = 1 / max(|d of the blurred guess|, eps); divided by the gradient's length for w_d.

    Differences are those to the next pixel, 0 in the last column and row, where there is no link.
    """
    taps = _gaussian(sigma)
    taps /= taps.sum()
    blurred = _blur(guess, taps)
    length = np.maximum(np.hypot(*_forward(guess)), _SHARPNESS)
    strengths = [1.0 / np.maximum(np.abs(part), eps) for part in _forward(blurred)]
    strengths[0][:, -1] = 0.0
    strengths[1][-1] = 0.0
    return Smoothness(*strengths, *(strength / length for strength in strengths))


def smoothness_by_window(guess: Map, sigma: float, eps: float) -> Smoothness:
    """W_d = sum of the window / (|window's sum of d| + eps); w_d = W_d / (|d| + eps).

    d is the difference of both neighbours (0 at the border), the window a Gaussian that is 0
    outside of the image.
    """
    taps = _gaussian(sigma)

    total = _blur(np.ones_like(guess), taps)
    strengths, weights = [], []
    for kernel in (_CORRELATION, _CORRELATION.T):
        filtered = cv2.filter2D(guess, -1, kernel, borderType=cv2.BORDER_REFLECT_101)
        change = np.asarray(filtered, dtype=np.float64)
        strength = total / (np.abs(_blur(change, taps)) + eps)
        strengths.append(strength)
        weights.append(strength / (np.abs(change) + eps))
    return Smoothness(*strengths, *weights)


def _blur(values: Map, taps: Map) -> Map:
    """Weighted sums over rows and columns, with zeros outside."""
    summed = cv2.sepFilter2D(values, -1, taps, taps, borderType=cv2.BORDER_CONSTANT)
    return np.asarray(summed, dtype=np.float64)


def _gaussian(sigma: float) -> Map:
    """About 5 sigma of a Gaussian, an odd number of taps, 1 in the middle."""
    taps = round(5 * sigma) | 1
    places = np.arange(taps, dtype=np.float64) - taps // 2
    values: Map = np.exp(-0.5 * (places / sigma) ** 2)
    return values


def _forward(values: Map) -> tuple[Map, Map]:
    """Differences to the right and to the lower neighbour, 0 in the last column and row."""
    across, down = np.zeros_like(values), np.zeros_like(values)
    across[:, :-1] = np.diff(values, axis=1)
    down[:-1] = np.diff(values, axis=0)
    return across, down
