"""Which frames of a sequence tell most about its runs: best, worst, gain, harm, first loss."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from nat2024.types import Floats

BEST, WORST, FIRST_LOSS = "best", "worst", "first loss"
GAIN, HARM = "largest gain", "largest harm"
PRIORITY = (GAIN, FIRST_LOSS, HARM, WORST, BEST)
"""Reasons, what tells most first."""

_WINDOW = 9  # frames that are averaged, so that one lucky frame is not picked
_NEAR = 3  # moments this close to each other are one
_NOTABLE = 0.05  # a gain in overlap below this is nothing to show


@dataclass(frozen=True, slots=True)
class Moment:
    """A row worth showing.

    Attributes:
        row: its number in the arrays.
        reasons: why: `BEST`, `WORST`, `GAIN`, `HARM`, `FIRST_LOSS`.
        run: the run that it is about, empty where all are meant.
    """

    row: int
    reasons: tuple[str, ...]
    run: str = ""


def choose_moments(
    overlaps: Mapping[str, Floats],
    pairs: Iterable[tuple[str, str]] = (),
    first_losses: Mapping[str, int | None] | None = None,
) -> list[Moment]:
    """The frames to look at, in their order; the same for the same input.

    Best and worst are those of the mean overlap over all runs, after the first tenth. Gain and
    harm are the largest differences that a pair makes. All are means over 9 frames around.

    Args:
        overlaps: (n,) by run, NaN where the truth is not known.
        pairs: (run with an enhancer, the same tracker alone).
        first_losses: row by run, as `find_failure` tells it.
    """
    found: list[Moment] = []
    length = max((len(values) for values in overlaps.values()), default=0)
    if length:
        smooth = {run: smoothed(values, length) for run, values in overlaps.items()}
        found += _extremes(smooth)
        found += _differences(smooth, pairs)
        found += _first_loss(first_losses or {})
    return _merged(found)


def smoothed(values: Floats, length: int | None = None) -> Floats:
    """Mean over 9 rows around each, over known ones only; NaN where the row itself is not known."""
    padded = np.full(len(values) if length is None else length, np.nan)
    padded[: len(values)] = values
    known = np.isfinite(padded)
    kernel = np.ones(_WINDOW)
    sums = np.convolve(np.where(known, padded, 0.0), kernel)[_WINDOW // 2 :][: len(padded)]
    counts = np.convolve(known.astype(np.float64), kernel)[_WINDOW // 2 :][: len(padded)]
    means: Floats = np.where(known, sums / np.maximum(counts, 1), np.nan)
    return means


def _extremes(smooth: Mapping[str, Floats]) -> list[Moment]:
    table = np.array(list(smooth.values()))
    known = np.isfinite(table)
    counts = known.sum(axis=0)
    mean = np.where(counts, np.where(known, table, 0).sum(axis=0) / np.maximum(counts, 1), np.nan)
    mean[: 1 + len(mean) // 10] = np.nan  # near the start, where every tracker is given the box
    if not np.isfinite(mean).any():
        return []
    return [
        Moment(int(np.nanargmax(mean)), (BEST,)),
        Moment(int(np.nanargmin(mean)), (WORST,)),
    ]


def _differences(smooth: Mapping[str, Floats], pairs: Iterable[tuple[str, str]]) -> list[Moment]:
    best: dict[str, tuple[float, Moment]] = {}
    for run, base in pairs:
        if run not in smooth or base not in smooth:
            continue
        difference = smooth[run] - smooth[base]
        if not np.isfinite(difference).any():
            continue
        for reason, sign in ((GAIN, 1), (HARM, -1)):
            row = int(np.nanargmax(sign * difference))
            size = sign * float(difference[row])
            if size > _NOTABLE and size > best.get(reason, (0.0, None))[0]:
                best[reason] = (size, Moment(row, (reason,), run))
    return [moment for _, moment in best.values()]


def _first_loss(first_losses: Mapping[str, int | None]) -> list[Moment]:
    losses = [(row, run) for run, row in first_losses.items() if row is not None]
    if not losses:
        return []
    row, run = min(losses)
    return [Moment(row, (FIRST_LOSS,), run)]


def _merged(moments: Iterable[Moment]) -> list[Moment]:
    """Moments in order; of two near each other that are about different runs the weaker goes."""
    merged: list[Moment] = []
    for moment in sorted(moments, key=_rank):
        near = [i for i, other in enumerate(merged) if abs(other.row - moment.row) <= _NEAR]
        if not near:
            merged.append(moment)
            continue
        other = merged[near[0]]
        if not moment.run or moment.run == other.run:
            merged[near[0]] = Moment(other.row, (*other.reasons, *moment.reasons), other.run)
    return sorted(merged, key=lambda moment: moment.row)


def _rank(moment: Moment) -> int:
    return PRIORITY.index(moment.reasons[0])
