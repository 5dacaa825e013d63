"""What each toolkit measures per frame: first row, bad rows, frames without target, divisor.

Sources, read for the facts: STVIR/pysot `toolkit` and the LDEnhancer release; the OTB and UAV123
MATLAB benchmarks; HengLan/LaSOT_Evaluation_Toolkit; visionml/pytracking `analysis`;
got-10k/toolkit; SilvioGiancola/TrackingNet-devkit.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final, TypeAlias

import numpy as np
import numpy.typing as npt

from nat2024.errors import ArrayContract
from nat2024.metrics.geometry import (
    Columns,
    centers_of,
    error_of,
    normalized_error_of,
    overlap_of,
)
from nat2024.metrics.parts import Parts
from nat2024.metrics.protocols import Protocol
from nat2024.types import Flags, Floats

Counts: TypeAlias = npt.NDArray[np.int64]
"""int64 (s,), one number a sequence."""

PASSES: Final = -1.0
"""Error of a frame that passes every threshold; NaN fails them all."""


@dataclass(frozen=True, slots=True, eq=False)
class Pair:
    """Results and ground truths of equal length, as fresh columns that may be written to.

    The sequences lie one after the other, and none is told from what is beside it.

    Attributes:
        predicted: (4, n).
        truth: (4, n).
        visible: (n,) or None.
        given: (n,), which columns of `predicted` were there, where some were filled in; else None.
        protocol: with its options.
        parts: which columns belong to which sequence.
    """

    predicted: Columns
    truth: Columns
    visible: Flags | None
    given: Flags | None
    protocol: Protocol
    parts: Parts


@dataclass(frozen=True, slots=True, eq=False)
class Measured:
    """What is compared with the thresholds, one value a frame.

    Attributes:
        overlap: NaN where the frame fails or does not count.
        error: pixels; NaN fails, `PASSES` passes.
        normalized: the same, in units of the true size; None where not defined.
        counted: which frames are in the divisor; None for all.
        averaged: which frames the average overlap is taken over; None for those counted.
    """

    overlap: Floats
    error: Floats | None
    normalized: Floats | None
    counted: Flags | None = None
    averaged: Flags | None = None


def measure_pysot(pair: Pair) -> Measured:
    """Three different notions of a frame without target, one a metric; the divisor is all rows."""
    p, t = pair.predicted, pair.truth
    overlap = overlap_of(p, t, "continuous")
    overlap[~((t[2] > 0) & (t[3] > 0))] = np.nan
    centers, true_centers = centers_of(p), centers_of(t)
    error = error_of(centers, true_centers)
    error[~((true_centers[0] > 0) & (true_centers[1] > 0))] = PASSES
    size = t[2:] + 1e-16
    true_centers /= size
    normalized = error_of(np.divide(centers, size, out=centers), true_centers)
    normalized[~((true_centers[0] > 0) & (true_centers[1] > 0))] = PASSES
    if pair.visible is not None:
        for values in (overlap, error, normalized):
            values[~pair.visible] = np.nan
    return Measured(overlap, error, normalized)


def measure_otb(pair: Pair) -> Measured:
    """Rows of four NaN or without size repeat the previous row."""
    p = pair.predicted
    bad = np.isnan(p).all(axis=0) | (p[2] <= 0) | (p[3] <= 0)
    return _measure_matlab(pair, bad, with_normalized=False)


def measure_lasot(pair: Pair) -> Measured:
    """Rows with a NaN or without size repeat the previous row; invisible frames fail."""
    p = pair.predicted
    bad = has_nan(p) | (p[2] <= 0) | (p[3] <= 0)
    measured = _measure_matlab(pair, bad, with_normalized=True)
    if pair.visible is not None:
        for values in (measured.overlap, measured.error, measured.normalized):
            assert values is not None
            values[~pair.visible] = np.nan
    return measured


def _measure_matlab(pair: Pair, bad: Flags, *, with_normalized: bool) -> Measured:
    p, t = pair.predicted, pair.truth
    _repeat_previous(pair, bad & ~has_nan(t))
    _take_first_rows(pair)
    target = (t > 0).all(axis=0)
    overlap = overlap_of(p, t, "lenient")
    overlap[~target] = np.nan
    centers, true_centers = centers_of(p), centers_of(t)
    error = error_of(centers, true_centers)
    error[~target] = PASSES
    normalized = None
    if with_normalized:
        normalized = normalized_error_of(centers, true_centers, t[2:], "centers")
        normalized[~target] = PASSES
    return Measured(overlap, error, normalized)


def measure_pytracking(pair: Pair) -> Measured:
    """Rows without size repeat the previous row; frames without target by label."""
    p, t, protocol = pair.predicted, pair.truth, pair.protocol
    _refuse_as_pytracking(pair)
    flat = (p[2] == 0) | (p[3] == 0)
    _repeat_previous(pair, flat & ~has_nan(t))
    _take_first_rows(pair)
    target = (t[2] > 0) & (t[3] > 0)
    if protocol.invalid_rule == "positive":
        target &= (t[0] > 0) & (t[1] > 0)
    if pair.visible is not None:
        target &= pair.visible
    overlap = overlap_of(p, t, "inclusive")
    overlap[~target] = np.nan
    unknown = np.isnan(overlap) & target
    if pair.given is not None:
        unknown &= pair.given
    if unknown.any():
        row = int(np.argmax(unknown)) + 1
        msg = f"predicted, row {row}: overlap is not a number; pytracking refuses such rows"
        raise ArrayContract(msg)
    centers, true_centers = centers_of(p), centers_of(t)
    error = error_of(centers, true_centers)
    error[~target] = PASSES if protocol.label == "uav" else np.nan
    normalized = normalized_error_of(centers, true_centers, t[2:], "centers")
    normalized[~target] = PASSES
    if protocol.label == "lasot" and pair.visible is not None:
        normalized[~pair.visible] = np.nan
    counted = target if protocol.exclude_invalid else None
    return Measured(overlap, error, normalized, counted, target)


def _refuse_as_pytracking(pair: Pair) -> None:
    p = pair.predicted
    bad = has_nan(p) | (p[2] < 0) | (p[3] < 0)
    if pair.given is not None:
        bad &= pair.given
    if bad.any():
        row = int(np.argmax(bad)) + 1
        msg = (
            f"predicted, row {row}: NaN or negative size, which pytracking refuses; "
            "repair the result or take another protocol"
        )
        raise ArrayContract(msg)
    absent = has_nan(pair.truth)
    if pair.protocol.label != "uav" and absent.any():
        row = int(np.argmax(absent)) + 1
        msg = (
            f"truth, row {row}: NaN, which pytracking refuses unless the dataset's label is uav; "
            'pass Protocol("pytracking", label="uav") or take another protocol'
        )
        raise ArrayContract(msg)


def measure_got10k_ope(pair: Pair) -> Measured:
    """Rows of NaN truth leave both sides, or are compared as numbers."""
    p, t = pair.predicted, pair.truth
    _take_first_rows(pair)
    overlap = overlap_of(p, t, "guarded")
    centers, true_centers = centers_of(p), centers_of(t)
    error = error_of(centers, true_centers)
    normalized = normalized_error_of(centers, true_centers, t[2:], "floored")
    if pair.protocol.invalid_rule == "none":
        return Measured(overlap, error, normalized)
    absent = has_nan(t)
    for values in (overlap, error, normalized):
        values[absent] = np.nan
    return Measured(overlap, error, normalized, ~absent)


def measure_got10k_ao(pair: Pair) -> Measured:
    """Overlap only, clipped to the frame; the first row and covered frames leave the score."""
    p, t, protocol = pair.predicted, pair.truth, pair.protocol
    if protocol.cover is not None:
        covers = [protocol.cover[:length] for length in pair.parts.lengths]
        counted = np.concatenate(covers) > 0
    elif pair.visible is not None:
        counted = pair.visible.copy()
    else:
        counted = ~has_nan(t)
    counted[pair.parts.starts] = False
    if protocol.frame_size is not None:
        _clip(p, protocol.frame_size)
        _clip(t, protocol.frame_size)
    # the toolkit's mean would become NaN by one bad row; here such a row overlaps nothing
    overlap = np.nan_to_num(overlap_of(p, t, "guarded"), nan=0.0)
    overlap[~counted] = np.nan
    return Measured(overlap, None, None, counted)


def _clip(boxes: Columns, frame_size: tuple[int, int]) -> None:
    # as the toolkit does: the corner is moved inside first, the size is cut only at the far side
    limit = np.array(frame_size, dtype=np.float64)[:, None]
    boxes[:2] = np.clip(boxes[:2], 0.0, limit)
    boxes[2:] = np.clip(boxes[2:], 0.0, limit - boxes[:2])


def measure_trackingnet(pair: Pair) -> Measured:
    """All boxes rounded to integers, all rows compared as numbers."""
    p, t = pair.predicted, pair.truth
    np.rint(p, out=p)
    np.rint(t, out=t)
    _take_first_rows(pair)
    centers, true_centers = centers_of(p), centers_of(t)
    return Measured(
        overlap_of(p, t, "lenient"),
        error_of(centers, true_centers),
        normalized_error_of(centers, true_centers, t[2:], "factored"),
    )


def measure_strict(pair: Pair) -> Measured:
    """Only frames with a target count, the first one never; a bad result row fails."""
    p, t = pair.predicted, pair.truth
    found = measure_strict_overlap(pair)
    centers, true_centers = centers_of(p), centers_of(t)
    error = error_of(centers, true_centers)
    normalized = normalized_error_of(centers, true_centers, t[2:], "difference")
    assert found.counted is not None
    unusable = ~found.counted | ~np.isfinite(p).all(axis=0)
    for values in (error, normalized):
        values[unusable] = np.nan
    return replace(found, error=error, normalized=normalized)


def measure_strict_overlap(pair: Pair) -> Measured:
    """The overlap alone of `measure_strict`."""
    p, t = pair.predicted, pair.truth
    counted = is_target(t)
    counted[pair.parts.starts] = False
    if pair.visible is not None:
        counted &= pair.visible
    overlap = overlap_of(p, t, "exact")
    overlap[~((p[2] > 0) & (p[3] > 0))] = 0.0
    overlap[~counted | ~np.isfinite(p).all(axis=0)] = np.nan
    return Measured(overlap, None, None, counted)


def is_target(boxes: Columns) -> Flags:
    """Which columns of (4, n) are four finite numbers with w, h > 0."""
    target: Flags = np.logical_and.reduce(np.isfinite(boxes), axis=0)
    target &= boxes[2] > 0
    target &= boxes[3] > 0
    return target


def count_others(boxes: Columns, parts: Parts, among: Flags | None = None) -> Counts:
    """How many columns of (4, n) are not `is_target` in each part, perhaps of some columns only."""
    # the usual case at a glance
    if among is None and boxes[2:].min() > 0 and np.isfinite(boxes).all():
        return np.zeros(len(parts), dtype=np.int64)
    others = ~is_target(boxes)
    return parts.count(others if among is None else others & among)


def has_nan(boxes: Columns) -> Flags:
    """Which columns of (4, n) hold a NaN."""
    found: Flags = np.logical_or.reduce(np.isnan(boxes), axis=0)
    return found


def _take_first_rows(pair: Pair) -> None:
    """The first row of each result is what it was given."""
    starts = pair.parts.starts
    pair.predicted[:, starts] = pair.truth[:, starts]


def _repeat_previous(pair: Pair, bad: Flags) -> None:
    if pair.given is not None:
        bad &= pair.given
    if not bad.any():
        return
    source = np.arange(len(bad))
    source[bad] = pair.parts.starts[pair.parts.number[bad]]
    np.maximum.accumulate(source, out=source)
    pair.predicted[:] = pair.predicted[:, source]


Measure: TypeAlias = Callable[[Pair], Measured]

MEASURES: Final[dict[str, Measure]] = {
    "pysot": measure_pysot,
    "otb": measure_otb,
    "lasot": measure_lasot,
    "pytracking": measure_pytracking,
    "got10k-ope": measure_got10k_ope,
    "got10k-ao": measure_got10k_ao,
    "trackingnet": measure_trackingnet,
    "strict": measure_strict,
}
