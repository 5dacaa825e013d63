"""Is a gain more than chance? Paired bootstrap over sequences.

Two results on the same sequences are compared sequence by sequence: sequences are drawn with
replacement, the difference of the means is taken anew each time, and the interval holds the middle
95 % of these differences (Efron and Tibshirani, An Introduction to the Bootstrap, 1993, chapter
13). The draws depend on the number of sequences and the seed alone, so that what else is compared
in the same call changes nothing.
"""

import functools
import math
from dataclasses import dataclass, fields, replace

import numpy as np
import numpy.typing as npt

from nat2024.types import Flags, Floats

RESAMPLES = 10_000
LEVEL = 0.95
FEWEST_SEQUENCES = 6
"""With fewer, even a gain in every one is no evidence at 5 %: 2 x 0.5^5 is 0.06."""


@dataclass(frozen=True, slots=True, eq=False)
class PairedGains:
    """What results gain over others on the same sequences; every field is an array of one shape.

    Attributes:
        sequences: number of sequences with a score in both.
        value: mean of the result.
        base_value: mean of what it is compared with.
        difference: `value - base_value`.
        difference_low: lower end of its interval, NaN for fewer than 2 sequences.
        difference_high: upper end.
        gain: percent of `base_value`, NaN where that is 0.
        gain_low: lower end of its interval.
        gain_high: upper end.
        improved: share of the sequences that get better, 0..1; equal ones do not.
        certain: whether the interval of the difference excludes 0, over at least
            `FEWEST_SEQUENCES` sequences.
    """

    sequences: npt.NDArray[np.int64]
    value: Floats
    base_value: Floats
    difference: Floats
    difference_low: Floats
    difference_high: Floats
    gain: Floats
    gain_low: Floats
    gain_high: Floats
    improved: Floats
    certain: Flags


def paired_bootstrap(
    values: npt.ArrayLike,
    bases: npt.ArrayLike,
    *,
    weights: npt.ArrayLike = 1.0,
    base_weights: npt.ArrayLike = 1.0,
    resamples: int = RESAMPLES,
    seed: int = 0,
    level: float = LEVEL,
) -> PairedGains:
    """Compare scores by sequence with others on the same sequences.

    Args:
        values: (..., S) scores of one or many results on S sequences; where either score is NaN
            the sequence leaves that comparison.
        bases: the same of what they are compared with, broadcast to `values`.
        weights: (..., S) share of each sequence in the mean of `values`, at least 0.
        base_weights: the same for `bases`.
        resamples: how often sequences are drawn.
        seed: of the draws.
        level: share of the draws that the interval holds.

    Returns:
        Arrays of shape (...).

    Example:
        >>> found = paired_bootstrap([0.5, 0.6, 0.7], [0.4, 0.5, 0.6])
        >>> round(float(found.difference), 6), float(found.improved), bool(found.certain)
        (0.1, 1.0, False)
    """
    arrays = (np.asarray(one, dtype=np.float64) for one in (values, bases, weights, base_weights))
    full = np.broadcast_arrays(*arrays)
    shape, count = full[0].shape[:-1], full[0].shape[-1]
    value, base, weight, base_weight = (one.reshape(math.prod(shape), count) for one in full)
    known = ~(np.isnan(value) | np.isnan(base))
    found = np.full((len(_COLUMNS), len(known)), np.nan)
    patterns, member = np.unique(known, axis=0, return_inverse=True)
    for number, pattern in enumerate(patterns):
        rows = np.flatnonzero(member.reshape(-1) == number)
        if pattern.any():
            pick = np.ix_(rows, np.flatnonzero(pattern))
            draws = _draws(int(pattern.sum()), resamples, seed).astype(np.float64)
            scores = _Scores(value[pick], weight[pick]), _Scores(base[pick], base_weight[pick])
            found[:, rows] = _compare(*scores, draws, level)
    found = found.round(_DIGITS)  # sums of other shapes are added in another order
    columns = {name: one.reshape(shape) for name, one in zip(_COLUMNS, found, strict=True)}
    counts = known.sum(axis=1).reshape(shape)
    beyond = (columns["difference_low"] > 0) | (columns["difference_high"] < 0)
    return PairedGains(sequences=counts, certain=beyond & (counts >= FEWEST_SEQUENCES), **columns)


_DIGITS = 12
_COLUMNS = tuple(f.name for f in fields(PairedGains) if f.name not in ("sequences", "certain"))


@dataclass(frozen=True, slots=True, eq=False)
class _Scores:
    """Scores (K, S) without NaN and the weights of the sequences in their mean."""

    table: Floats
    weight: Floats

    @property
    def is_even(self) -> bool:
        """Whether all sequences weigh the same."""
        first = float(self.weight.flat[0])
        return first > 0 and bool((self.weight == first).all())

    def means(self, draws: Floats) -> Floats:
        """Weighted means (K, B) over B draws (B, S); NaN where all weights are 0."""
        if self.is_even:
            return np.asarray(self.table @ draws.T / draws.sum(axis=1))
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray((self.weight * self.table) @ draws.T / (self.weight @ draws.T))


def _differences(value: _Scores, base: _Scores, draws: Floats) -> tuple[Floats, Floats]:
    """Differences of the means, and means of the base, (K, B)."""
    base_means = base.means(draws)
    if value.is_even and base.is_even:  # equal scores differ by exactly nothing
        return replace(value, table=value.table - base.table).means(draws), base_means
    return value.means(draws) - base_means, base_means


def _compare(value: _Scores, base: _Scores, draws: Floats, level: float) -> Floats:
    """Rows `_COLUMNS` of K comparisons."""
    count = draws.shape[1]
    difference, mean = (one[:, 0] for one in _differences(value, base, np.ones((1, count))))
    if count > 1:
        drawn, means = _differences(value, base, draws)
        interval, gains = _interval(drawn, level), _interval(_percent(drawn, means), level)
    else:  # the interval of one sequence would be a point, and look certain
        interval = gains = np.full((2, len(mean)), np.nan)
    improved = (value.table > base.table).mean(axis=1)
    gain = _percent(difference, mean)
    return np.stack([mean + difference, mean, difference, *interval, gain, *gains, improved])


def _percent(difference: Floats, base: Floats) -> Floats:
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(base < 10.0**-_DIGITS, np.nan, 100.0 * difference / base)


def _interval(drawn: Floats, level: float) -> Floats:
    """Both ends (2, K) of the middle of the draws (K, B); draws without a mean do not count."""
    ends = [50.0 * (1.0 - level), 50.0 * (1.0 + level)]
    known = ~np.isnan(drawn)
    whole = known.all(axis=1)
    found = np.full((2, len(drawn)), np.nan)
    if whole.any():
        found[:, whole] = np.percentile(drawn[whole], ends, axis=1)
    for row in np.flatnonzero(known.any(axis=1) & ~whole):
        found[:, row] = np.percentile(drawn[row, known[row]], ends)
    return found


@functools.lru_cache(maxsize=16)
def _draws(count: int, resamples: int, seed: int) -> npt.NDArray[np.uint16]:
    """How often each of `count` sequences is in each draw, (resamples, count)."""
    chosen = np.random.default_rng([seed, count]).integers(count, size=(resamples, count))
    chosen += np.arange(resamples)[:, np.newaxis] * count
    counts = np.bincount(chosen.ravel(), minlength=resamples * count)
    table = counts.reshape(resamples, count).astype(np.uint16)
    table.setflags(write=False)
    return table
