"""Tone curves: the best one for pairs of values by least squares, and applying it.

A curve is float64 (3, 256): for each channel, in the order in which it was fed, what the 8-bit
levels 0/255 .. 255/255 become, linear between them. Nothing makes it monotone.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from nat2024.types import Floats

LEVELS = 256
"""8-bit images have these levels, so that nothing is lost on them; between them such a curve leaves
a smooth one by its second derivative / 520 000, 2e-5 for those of networks."""

_LEAST_WEIGHT = 1e-3
_RIDGE = 1e-9


class CurveFit:
    """Collects values before and after, and solves for the curve; memory does not grow."""

    def __init__(self) -> None:
        self._diagonal = np.zeros((3, LEVELS))
        self._beside = np.zeros((3, LEVELS))
        self._right = np.zeros((3, LEVELS))
        self._weight = np.zeros((3, LEVELS))

    def add(self, before: Floats, after: Floats) -> None:
        """Add an image: float64 (H, W, 3) each, `before` in 0..1."""
        for channel in range(3):
            lower, part = _places(before[..., channel])
            y = after[..., channel].ravel()
            lower, part = lower.ravel(), part.ravel()
            rest = 1 - part
            for index, values in (
                (self._diagonal, (rest * rest, part * part)),
                (self._right, (rest * y, part * y)),
                (self._weight, (rest, part)),
            ):
                index[channel] += np.bincount(lower, values[0], LEVELS)
                index[channel, 1:] += np.bincount(lower, values[1], LEVELS)[:-1]
            self._beside[channel] += np.bincount(lower, rest * part, LEVELS)

    def observed(self) -> npt.NDArray[np.bool_]:
        """Which levels occurred, or lie beside values that did, bool (3, 256)."""
        seen: npt.NDArray[np.bool_] = self._weight > _LEAST_WEIGHT
        return seen

    def solve(self) -> Floats:
        """The curve of least squares.

        Levels that did not occur lie on the straight line between their observed neighbours; below
        the lowest and above the highest, on the line to the end of the identity, 0 or 1: an
        enhancer most often leaves black black and white white.
        """
        return np.stack([self._solve_channel(channel) for channel in range(3)])

    def _solve_channel(self, channel: int) -> Floats:
        seen = self.observed()[channel]
        levels: Floats = np.arange(LEVELS) / (LEVELS - 1)
        if not seen.any():
            return levels
        # 8-bit values fall on the levels, and the system is diagonal: the solution are the means.
        means = self._right[channel, seen] / self._weight[channel, seen]
        values = means
        if self._beside[channel].any():
            values = self._solve_system(channel, seen, means)
        knots = levels[seen]
        if not seen[0]:
            knots, values = np.append(0.0, knots), np.append(0.0, values)
        if not seen[-1]:
            knots, values = np.append(knots, 1.0), np.append(values, 1.0)
        return np.asarray(np.interp(levels, knots, values), dtype=np.float64)

    def _solve_system(self, channel: int, seen: npt.NDArray[Any], means: Floats) -> Floats:
        beside = self._beside[channel, :-1]
        matrix = np.diag(self._diagonal[channel]) + np.diag(beside, 1) + np.diag(beside, -1)
        matrix = matrix[np.ix_(seen, seen)]
        # Where values leave a level undetermined, it takes the mean of what is near.
        ridge = _RIDGE * float(self._weight[channel].sum())
        matrix[np.diag_indices_from(matrix)] += ridge
        solution = np.linalg.solve(matrix, self._right[channel, seen] + ridge * means)
        return np.asarray(solution, dtype=np.float64)


def apply_tone_curve(curve: Floats, values: Floats) -> Floats:
    """What a curve (3, 256) makes of float64 (..., 3) in 0..1; linear between the levels."""
    answer = np.empty_like(values)
    for channel in range(3):
        lower, part = _places(values[..., channel])
        low, high = curve[channel][lower], curve[channel][np.minimum(lower + 1, LEVELS - 1)]
        answer[..., channel] = low + part * (high - low)
    return answer


def _places(values: Floats) -> tuple[npt.NDArray[np.intp], Floats]:
    """The level below each value, and how far on towards the next it lies, 0..1."""
    scaled = values * (LEVELS - 1)
    nearest = np.rint(scaled)
    # a float32 value that differs from a level by its own rounding is that level
    scaled = np.where(np.abs(scaled - nearest) < 1e-4, nearest, scaled)
    lower = np.floor(scaled)
    return lower.astype(np.intp), scaled - lower
