"""Curves over thresholds: which share of frames passes each of them.

Every curve is a count divided by a number of frames. The counts are exactly those of comparing
each value with each threshold, found in one pass over the values; NaN passes no threshold.
"""

from typing import Final

import numpy as np
import numpy.typing as npt

from nat2024.errors import ArrayContract
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

    The product of a value and the inverse step may be off by rounding, but by far less than one
    step, so comparing with the two thresholds around it settles the place exactly.
    """

    __slots__ = ("_inverse_step", "_limits", "count")

    def __init__(self, thresholds: Floats) -> None:
        self.count = len(thresholds)
        self._inverse_step = round((self.count - 1) / float(thresholds[-1]), 6)
        # NaN at the end: comparing with it is never true
        self._limits = np.concatenate([thresholds, np.full(3, np.nan)])

    def rank(self, values: Floats, *, inclusive: bool = False) -> npt.NDArray[np.intp]:
        """How many thresholds t have t < v (t <= v where `inclusive`); all of them for NaN."""
        compare = np.less_equal if inclusive else np.less
        scaled = values * self._inverse_step
        np.fmin(scaled, self.count, out=scaled)
        np.maximum(scaled, 0.0, out=scaled)
        place = scaled.astype(np.intp)
        rank: npt.NDArray[np.intp] = place + compare(self._limits.take(place), values)
        place += 1
        rank += compare(self._limits.take(place), values)
        return rank

    def count_above(self, values: Floats, *, inclusive: bool = False) -> Floats:
        """As the function `count_above` for these thresholds."""
        passed = self.rank(values, inclusive=inclusive)
        return _above(passed, self.count, int(np.count_nonzero(np.isnan(values))))

    def count_within(self, values: Floats) -> Floats:
        """As the function `count_within` for these thresholds."""
        return _within(self.rank(values), self.count)


def _above(passed: npt.NDArray[np.intp], thresholds: int, nans: int) -> Floats:
    # a value passes as many thresholds as lie below it; NaN was ranked above all
    histogram = np.bincount(passed, minlength=thresholds + 1)
    above = (len(passed) - nans) - histogram.cumsum()[:-1]
    return above.astype(np.float64)


def _within(rank: npt.NDArray[np.intp], thresholds: int) -> Floats:
    histogram = np.bincount(rank, minlength=thresholds + 1)
    return histogram.cumsum()[:-1].astype(np.float64)


def count_above(values: Floats, thresholds: Floats, *, inclusive: bool = False) -> Floats:
    """For each threshold t the number of values v with v > t, or v >= t where `inclusive`."""
    passed = np.searchsorted(thresholds, values, side="right" if inclusive else "left")
    return _above(passed, len(thresholds), int(np.count_nonzero(np.isnan(values))))


def count_within(values: Floats, thresholds: Floats) -> Floats:
    """For each threshold t the number of values v with v <= t."""
    return _within(np.searchsorted(thresholds, values, side="left"), len(thresholds))


def share(counts: Floats, frames: float) -> Floats:
    """`counts` / `frames`; NaN where there is no frame."""
    return counts / frames if frames else np.full_like(counts, np.nan)


def mean(values: Floats) -> float:
    """Plain mean; NaN where there is no value."""
    return float(np.add.reduce(values)) / len(values) if len(values) else float("nan")


def trapezoid(curve: Floats) -> float:
    """Area under a curve of evenly spaced values by the trapezoidal rule, over a range of 1."""
    return float((curve.sum() - (curve[0] + curve[-1]) / 2) / (len(curve) - 1))


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
