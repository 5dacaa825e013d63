"""Curves over thresholds: which share of frames passes each of them.

Every curve is a count divided by a number of frames. The counts are exactly those of comparing
each value with each threshold, found in one pass over the values; NaN passes no threshold.
"""

from typing import Final

import numpy as np
import numpy.typing as npt

from nat2024.errors import ArrayContract
from nat2024.metrics.parts import Parts
from nat2024.types import Floats


def _frozen(values: npt.ArrayLike) -> Floats:
    array = np.array(values, dtype=np.float64)
    array.setflags(write=False)
    return array


SUCCESS_THRESHOLDS: Final[Floats] = _frozen(np.arange(21) * 0.05)
"""Overlap 0, 0.05, ..., 1 as `arange(0, 1.05, 0.05)` gives it: 0.15000000000000002, ..."""

PRECISION_THRESHOLDS: Final[Floats] = _frozen(np.arange(51.0))
"""Centre error 0, 1, ..., 50 pixels."""

NORMALIZED_PRECISION_THRESHOLDS: Final[Floats] = _frozen(np.arange(51) / 100)
"""Normalised centre error 0, 0.01, ..., 0.5."""


def success_curve(
    overlap: npt.ArrayLike,
    thresholds: npt.ArrayLike = SUCCESS_THRESHOLDS,
    *,
    frames: int | None = None,
    inclusive: bool = False,
) -> Floats:
    """Share of frames whose overlap is above each threshold.

    Wu et al., Online Object Tracking: A Benchmark, CVPR 2013. With the strict comparison a perfect
    tracker fails at threshold 1, so the mean of the 21 values is 20/21.

    Args:
        overlap: (n,) intersection over union; NaN passes nothing.
        thresholds: ascending.
        frames: divisor; the number of values where None.
        inclusive: count values equal to the threshold too.

    Returns:
        float64, one share a threshold; NaN where there is no frame.

    Raises:
        ArrayContract: `overlap` or `thresholds` is not one-dimensional, or not ascending.

    Example:
        >>> success_curve([0.2, 0.6], [0.0, 0.2, 0.5]).tolist()
        [1.0, 0.5, 0.5]
    """
    values, limits = _checked(overlap, thresholds, "overlap")
    counts = count_above(values, limits, inclusive=inclusive)
    return share(counts, len(values) if frames is None else frames)


def precision_curve(
    error: npt.ArrayLike,
    thresholds: npt.ArrayLike = PRECISION_THRESHOLDS,
    *,
    frames: int | None = None,
) -> Floats:
    """Share of frames whose centre error in pixels is at most each threshold.

    Wu et al., Online Object Tracking: A Benchmark, CVPR 2013.

    Args:
        error: (n,) distances; NaN passes nothing.
        thresholds: ascending.
        frames: divisor; the number of values where None.

    Returns:
        float64, one share a threshold; NaN where there is no frame.

    Raises:
        ArrayContract: `error` or `thresholds` is not one-dimensional, or not ascending.

    Example:
        >>> precision_curve([1.0, 3.0], [0, 1, 2, 3]).tolist()
        [0.0, 0.5, 0.5, 1.0]
    """
    values, limits = _checked(error, thresholds, "error")
    return share(count_within(values, limits), len(values) if frames is None else frames)


def normalized_precision_curve(
    error: npt.ArrayLike,
    thresholds: npt.ArrayLike = NORMALIZED_PRECISION_THRESHOLDS,
    *,
    frames: int | None = None,
) -> Floats:
    """Share of frames whose normalised centre error is at most each threshold.

    Muller et al., TrackingNet, ECCV 2018. Arguments, result and errors as in `precision_curve`.

    Example:
        >>> normalized_precision_curve([0.1, 0.3], [0.0, 0.1, 0.2]).tolist()
        [0.0, 0.5, 0.5]
    """
    return precision_curve(error, thresholds, frames=frames)


class Grid:
    """Evenly spaced thresholds from 0, in which a value is placed by arithmetic, not by search.

    The product of a value and the inverse step may be off by rounding, but by far less than half a
    step, so comparing with the nearest threshold settles the place exactly.
    """

    __slots__ = ("_inverse_step", "_limits", "count")

    def __init__(self, thresholds: Floats) -> None:
        self.count = len(thresholds)
        self._inverse_step = round((self.count - 1) / float(thresholds[-1]), 6)
        # NaN at the end: comparing with it is never true
        self._limits = np.append(thresholds, np.nan)

    def rank(self, values: Floats, *, inclusive: bool = False) -> npt.NDArray[np.intp]:
        """How many thresholds t have t < v (t <= v where `inclusive`); all of them for NaN."""
        scaled = values * self._inverse_step
        np.rint(scaled, out=scaled)
        np.fmin(scaled, self.count, out=scaled)
        np.maximum(scaled, 0.0, out=scaled)
        nearest = scaled.astype(np.intp)
        limits = self._limits.take(nearest)
        nearest += limits <= values if inclusive else limits < values
        return nearest

    def count_above(self, values: Floats, parts: Parts, *, inclusive: bool = False) -> Floats:
        """As the function `count_above` for these thresholds, float64 (s, count)."""
        counted = parts.lengths - parts.count(np.isnan(values))  # NaN was ranked above all
        rank = self.rank(values, inclusive=inclusive)
        return (counted[:, np.newaxis] - self._reached(rank, parts)).astype(np.float64)

    def count_within(self, values: Floats, parts: Parts) -> Floats:
        """As the function `count_within` for these thresholds, float64 (s, count)."""
        return self._reached(self.rank(values), parts).astype(np.float64)

    def _reached(self, rank: npt.NDArray[np.intp], parts: Parts) -> npt.NDArray[np.int64]:
        # a value passes as many thresholds as lie below it
        return parts.histograms(rank, self.count + 1).cumsum(axis=1)[:, :-1]


def count_above(values: Floats, thresholds: Floats, *, inclusive: bool = False) -> Floats:
    """For each threshold t the number of values v with v > t, or v >= t where `inclusive`."""
    passed = np.searchsorted(thresholds, values, side="right" if inclusive else "left")
    histogram = np.bincount(passed, minlength=len(thresholds) + 1)
    counted = len(values) - np.count_nonzero(np.isnan(values))  # NaN is ranked above all
    return (counted - histogram.cumsum()[:-1]).astype(np.float64)


def count_within(values: Floats, thresholds: Floats) -> Floats:
    """For each threshold t the number of values v with v <= t."""
    rank = np.searchsorted(thresholds, values, side="left")
    histogram = np.bincount(rank, minlength=len(thresholds) + 1)
    return histogram.cumsum()[:-1].astype(np.float64)


def share(counts: Floats, frames: float) -> Floats:
    """`counts` / `frames`; NaN where there is no frame."""
    return counts / frames if frames else np.full_like(counts, np.nan)


def mean(values: Floats) -> float:
    """Plain mean; NaN where there is no value."""
    return float(np.add.reduce(values)) / len(values) if len(values) else float("nan")


def shares(counts: Floats, frames: Floats) -> Floats:
    """Each row of `counts` (s, t) / its number of `frames` (s,); NaN where there is no frame."""
    return np.asarray(counts / np.where(frames > 0, frames, np.nan)[:, np.newaxis])


def means(curves: Floats) -> Floats:
    """Plain mean of each row of (s, t)."""
    return np.asarray(np.add.reduce(curves, axis=1) / curves.shape[1])


def trapezoids(curves: Floats) -> Floats:
    """Area under each row of evenly spaced values by the trapezoidal rule, over a range of 1."""
    inner = np.add.reduce(curves, axis=1) - (curves[:, 0] + curves[:, -1]) / 2
    return np.asarray(inner / (curves.shape[1] - 1))


def _checked(values: npt.ArrayLike, thresholds: npt.ArrayLike, name: str) -> tuple[Floats, Floats]:
    array = np.asarray(values, dtype=np.float64)
    limits = np.asarray(thresholds, dtype=np.float64)
    for label, given in ((name, array), ("thresholds", limits)):
        if given.ndim != 1:
            msg = f"{label}: shape {given.shape}, expected one value a frame, shape (n,)"
            raise ArrayContract(msg)
    if np.isnan(limits).any() or (limits[1:] < limits[:-1]).any():
        msg = "thresholds: not in ascending order"
        raise ArrayContract(msg)
    return array, limits
