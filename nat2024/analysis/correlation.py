"""Rank correlation between two numbers of the same sequences, with an interval."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from nat2024.errors import ArrayContract, UsageError
from nat2024.types import Floats

RESAMPLES = 10_000
LEAST = 6
"""Fewer pairs than these have no interval worth the name."""

_AT_ONCE = 2_000_000  # numbers in one piece of the resamples, which bounds the memory


@dataclass(frozen=True, slots=True)
class RankCorrelation:
    """Spearman's rank correlation of pairs.

    Attributes:
        value: in -1..1; NaN for fewer than two pairs, or where one side never differs.
        low: lower end of the 95 % interval, NaN for fewer than six pairs.
        high: upper end.
        pairs: that have both numbers.
    """

    value: float
    low: float
    high: float
    pairs: int

    @property
    def is_certain(self) -> bool:
        """Whether the interval leaves out 0."""
        return bool(self.low > 0 or self.high < 0)


def rank_correlation(
    first: npt.ArrayLike,
    second: npt.ArrayLike,
    *,
    resamples: int = RESAMPLES,
    seed: int = 0,
) -> RankCorrelation:
    """Spearman's rank correlation with a percentile bootstrap interval over the pairs.

    Equal numbers share their mean rank. Resamples in which one side never differs tell nothing and
    are left out.

    Args:
        first: (n,) numbers.
        second: (n,) numbers; pairs with a NaN are left out.
        resamples: of the bootstrap.
        seed: of the bootstrap; equal input gives equal output.

    Raises:
        ArrayContract: the two are not of one dimension and length.
        UsageError: no resamples.

    Example:
        >>> rank_correlation([1, 2, 3, 4, 5], [10, 20, 30, 40, 1000]).value
        1.0
    """
    x, y = np.asarray(first, dtype=np.float64), np.asarray(second, dtype=np.float64)
    if x.ndim != 1 or x.shape != y.shape:
        msg = f"rank correlation takes two arrays of the shape (n,), not {x.shape} and {y.shape}"
        raise ArrayContract(msg)
    if resamples < 1:
        msg = f"resamples={resamples}: at least 1"
        raise UsageError(msg)
    known = np.isfinite(x) & np.isfinite(y)
    x, y = x[known], y[known]
    value = float(_correlate(_ranks(x[None]), _ranks(y[None]))[0]) if len(x) > 1 else float("nan")
    low = high = float("nan")
    if len(x) >= LEAST and np.isfinite(value):
        found = _resampled(x, y, resamples, seed)
        if len(found):
            low, high = np.quantile(found, [0.025, 0.975]).tolist()
    return RankCorrelation(value, low, high, len(x))


def _resampled(x: Floats, y: Floats, resamples: int, seed: int) -> Floats:
    random = np.random.default_rng(seed)
    rows = max(1, _AT_ONCE // len(x))
    parts = []
    for start in range(0, resamples, rows):
        chosen = random.integers(0, len(x), (min(rows, resamples - start), len(x)))
        parts.append(_correlate(_ranks(x[chosen]), _ranks(y[chosen])))
    values = np.concatenate(parts)
    return values[np.isfinite(values)]


def _ranks(values: Floats) -> Floats:
    """Ranks along the rows of (m, n), equal numbers with their mean rank."""
    order = np.argsort(values, axis=1, kind="stable")
    ordered = np.take_along_axis(values, order, axis=1)
    new = np.ones(values.shape, dtype=np.bool_)
    new[:, 1:] = ordered[:, 1:] != ordered[:, :-1]
    places = np.arange(values.shape[1])
    starts = np.maximum.accumulate(np.where(new, places, 0), axis=1)
    last = np.ones(values.shape, dtype=np.bool_)
    last[:, :-1] = new[:, 1:]
    reverse = np.where(last, places, values.shape[1] - 1)[:, ::-1]
    ends = np.minimum.accumulate(reverse, axis=1)[:, ::-1]
    ranks = np.empty(values.shape)
    np.put_along_axis(ranks, order, (starts + ends) / 2, axis=1)
    return ranks


def _correlate(first: Floats, second: Floats) -> Floats:
    a = first - first.mean(axis=1, keepdims=True)
    b = second - second.mean(axis=1, keepdims=True)
    with np.errstate(invalid="ignore", divide="ignore"):
        found: Floats = (a * b).sum(axis=1) / np.sqrt((a**2).sum(axis=1) * (b**2).sum(axis=1))
    return found
