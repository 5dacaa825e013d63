"""Scores of several sequences at once: the same numbers to the last bit, in fewer steps.

Everything but the counts at the end is computed frame by frame, so sequences may lie one after the
other in one array; the counts are taken for each of them.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from nat2024.errors import ArrayContract
from nat2024.metrics.curves import (
    NORMALIZED_PRECISION_THRESHOLDS,
    PRECISION_THRESHOLDS,
    SUCCESS_THRESHOLDS,
    Grid,
    mean,
    means,
    shares,
    trapezoids,
)
from nat2024.metrics.geometry import as_boxes
from nat2024.metrics.lengths import align
from nat2024.metrics.parts import Parts
from nat2024.metrics.protocols import LengthRule, Protocol
from nat2024.metrics.scores import COLUMN, CURVE_COLUMNS, ROW_LENGTH
from nat2024.metrics.toolkits import MEASURES, Measured, Pair, count_others, measure_strict_overlap
from nat2024.types import Boxes, Flags, Floats

_EPSILON = float(np.finfo(np.float64).eps)
_SUCCESS: Final = Grid(SUCCESS_THRESHOLDS)
_SUCCESS_GOT10K_AO: Final = Grid(np.linspace(0, 1, 101)[::5])
_PRECISION: Final = Grid(PRECISION_THRESHOLDS)
_PRECISION_TRACKINGNET: Final = Grid(np.linspace(0, 50, 21))
_NORMALIZED: Final = Grid(NORMALIZED_PRECISION_THRESHOLDS)
_NORMALIZED_GOT10K: Final = Grid(np.linspace(0, 0.5, 51))
_NORMALIZED_TRACKINGNET: Final = Grid(np.linspace(0, 0.5, 21))


@dataclass(frozen=True, slots=True, eq=False)
class Aligned:
    """A result and its ground truth, brought to one length.

    Attributes:
        predicted: float64 (n, 4).
        truth: float64 (n, 4).
        visible: bool (n,) or None.
        present: how many rows of `predicted` were there; the rest was filled in.
        length_predicted: rows of the result as given.
        length_truth: rows of the ground truth as given.
    """

    predicted: Boxes
    truth: Boxes
    visible: Flags | None
    present: int
    length_predicted: int
    length_truth: int


def aligned(
    predicted: npt.ArrayLike,
    truth: npt.ArrayLike,
    visible: npt.ArrayLike | None,
    protocol: Protocol,
    rule: LengthRule | None,
) -> Aligned:
    """Check what is to be compared, and bring it to one length; arguments as `evaluate_boxes`.

    Raises:
        ArrayContract: an array of the wrong shape, or no row of truth.
        LengthMismatch: unequal lengths that are refused; both are named.
    """
    given, wanted = as_boxes(predicted, "predicted"), as_boxes(truth, "truth")
    if len(wanted) == 0:
        msg = "truth: no rows; there is nothing to score against"
        raise ArrayContract(msg)
    _check_cover(protocol, len(wanted))
    flags = _as_flags(visible, len(wanted))
    kept, rows, present = align(given, wanted, protocol, rule)
    flags = None if flags is None else flags[:rows]
    return Aligned(kept, wanted[:rows], flags, present, len(given), len(wanted))


def _as_flags(visible: npt.ArrayLike | None, rows: int) -> Flags | None:
    if visible is None:
        return None
    flags = np.asarray(visible)
    if flags.shape != (rows,) or flags.dtype.kind not in "biu":
        msg = (
            f"visible: shape {flags.shape} of {flags.dtype}, expected one flag (bool or 0/1) "
            f"for each of the {rows} rows of truth"
        )
        raise ArrayContract(msg)
    return flags.astype(np.bool_)


def _check_cover(protocol: Protocol, rows: int) -> None:
    if protocol.cover is not None and len(protocol.cover) != rows:
        msg = f"cover: {len(protocol.cover)} values for {rows} rows of truth"
        raise ArrayContract(msg)


def pair_of(given: Sequence[Aligned], protocol: Protocol) -> Pair:
    """What is measured at once: all have flags of visibility, or none has any."""
    lengths = [len(one.truth) for one in given]
    filled = None
    if [one.present for one in given] != lengths:
        filled = np.concatenate([np.arange(len(one.truth)) < one.present for one in given])
    flags = [one.visible for one in given if one.visible is not None]
    return Pair(
        _columns([one.predicted for one in given]),
        _columns([one.truth for one in given]),
        np.concatenate(flags) if flags else None,
        filled,
        protocol,
        Parts.of(lengths),
    )


def _columns(boxes: list[Boxes]) -> Floats:
    """Fresh columns (4, n) of all boxes."""
    return (boxes[0] if len(boxes) == 1 else np.concatenate(boxes)).T.copy()


def measure_rows(given: Sequence[Aligned], pair: Pair) -> tuple[Floats, Measured]:
    """Every number of each sequence, and what was measured of the frames.

    Args:
        given: at least one.
        pair: made of them; it may be written to.

    Returns:
        float64 (s, `ROW_LENGTH`), NaN where the protocol does not define a score, and the values
        of the frames of all sequences.

    Raises:
        ArrayContract: rows that the protocol's toolkit refuses, numbered from the first of all.
    """
    rows = np.full((len(given), ROW_LENGTH), np.nan)
    lengths = pair.parts.lengths
    rows[:, COLUMN["rows"]] = lengths
    rows[:, COLUMN["length_predicted"]] = [one.length_predicted for one in given]
    rows[:, COLUMN["length_truth"]] = [one.length_truth for one in given]
    rows[:, COLUMN["invalid_truth"]] = count_others(pair.truth, pair.parts)
    rows[:, COLUMN["bad_results"]] = count_others(pair.predicted, pair.parts, pair.given)
    measured = MEASURES[pair.protocol.name](pair)
    frames = lengths if measured.counted is None else pair.parts.count(measured.counted)
    rows[:, COLUMN["frames"]] = frames
    divisor = frames.astype(np.float64)
    if pair.protocol.name in ("otb", "lasot"):
        divisor += _EPSILON
    _write_success(rows, measured, pair, divisor)
    _write_precision(rows, measured, pair, divisor)
    _write_normalized(rows, measured, pair, divisor)
    return rows, measured


def strict_success(pair: Pair) -> Floats:
    """The `success_auc` of each sequence under the protocol `strict`, float64 (s,)."""
    measured = measure_strict_overlap(pair)
    assert measured.counted is not None
    frames = pair.parts.count(measured.counted).astype(np.float64)
    return means(shares(_SUCCESS.count_above(measured.overlap, pair.parts, inclusive=True), frames))


def _write_success(rows: Floats, measured: Measured, pair: Pair, divisor: Floats) -> None:
    name = pair.protocol.name
    grid = _SUCCESS_GOT10K_AO if name == "got10k-ao" else _SUCCESS
    inclusive = name in ("strict", "trackingnet")
    curves = shares(grid.count_above(measured.overlap, pair.parts, inclusive=inclusive), divisor)
    rows[:, CURVE_COLUMNS["success_curve"]] = curves
    if name == "trackingnet":
        rows[:, COLUMN["success_auc"]] = trapezoids(curves)
    elif name != "got10k-ao":
        rows[:, COLUMN["success_auc"]] = means(curves)
    if name in ("got10k-ao", "got10k-ope", "pytracking"):
        rows[:, COLUMN["success_rate_50"]] = curves[:, 10]
    if name in ("got10k-ao", "pytracking"):
        rows[:, COLUMN["success_rate_75"]] = curves[:, 15]
        flags = measured.counted if measured.averaged is None else measured.averaged
        assert flags is not None
        values = [(measured.overlap[one], flags[one]) for one in pair.parts.slices()]
        rows[:, COLUMN["average_overlap"]] = [mean(overlap[own]) for overlap, own in values]


def _write_precision(rows: Floats, measured: Measured, pair: Pair, divisor: Floats) -> None:
    if measured.error is None:
        return
    curves = shares(_PRECISION.count_within(measured.error, pair.parts), divisor)
    rows[:, CURVE_COLUMNS["precision_curve"]] = curves
    rows[:, COLUMN["precision_20"]] = curves[:, 20]
    if pair.protocol.name == "trackingnet":
        own = shares(_PRECISION_TRACKINGNET.count_within(measured.error, pair.parts), divisor)
        rows[:, COLUMN["precision_auc"]] = trapezoids(own)


def _write_normalized(rows: Floats, measured: Measured, pair: Pair, divisor: Floats) -> None:
    if measured.normalized is None:
        return
    name = pair.protocol.name
    grid = _NORMALIZED_GOT10K if name == "got10k-ope" else _NORMALIZED
    curves = shares(grid.count_within(measured.normalized, pair.parts), divisor)
    rows[:, CURVE_COLUMNS["normalized_precision_curve"]] = curves
    rows[:, COLUMN["normalized_precision_20"]] = curves[:, 20]
    area = means(curves)
    if name == "trackingnet":
        own = _NORMALIZED_TRACKINGNET.count_within(measured.normalized, pair.parts)
        area = trapezoids(shares(own, divisor))
    rows[:, COLUMN["normalized_precision_auc"]] = area
