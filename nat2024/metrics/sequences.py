"""Scores of one result on one sequence."""

from collections.abc import Callable
from dataclasses import dataclass, field, fields
from typing import Any, Final, TypeAlias

import numpy as np
import numpy.typing as npt

from nat2024.errors import ArrayContract, LengthMismatch
from nat2024.metrics.curves import (
    NORMALIZED_PRECISION_THRESHOLDS,
    PRECISION_THRESHOLDS,
    SUCCESS_THRESHOLDS,
    Grid,
    mean,
    share,
    trapezoid,
)
from nat2024.metrics.geometry import as_boxes
from nat2024.metrics.lengths import align
from nat2024.metrics.protocols import LengthRule, Protocol, check_length_rule, get_protocol
from nat2024.metrics.toolkits import MEASURES, Measured, Pair, count_targets
from nat2024.types import Flags, Floats

_EPSILON = float(np.finfo(np.float64).eps)
_SUCCESS: Final = Grid(SUCCESS_THRESHOLDS)
_SUCCESS_GOT10K_AO: Final = Grid(np.linspace(0, 1, 101)[::5])
_PRECISION: Final = Grid(PRECISION_THRESHOLDS)
_PRECISION_TRACKINGNET: Final = Grid(np.linspace(0, 50, 21))
_NORMALIZED: Final = Grid(NORMALIZED_PRECISION_THRESHOLDS)
_NORMALIZED_GOT10K: Final = Grid(np.linspace(0, 0.5, 51))
_NORMALIZED_TRACKINGNET: Final = Grid(np.linspace(0, 0.5, 21))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Scores:
    """Scores in 0..1 and curves; NaN where the protocol does not define one.

    Attributes:
        protocol: with its options.
        frames: frames in the divisor.
        success_auc: area under the success curve.
        precision_20: share of frames with a centre error of at most 20 px.
        normalized_precision_20: share of frames with a normalised centre error of at most 0.20.
        normalized_precision_auc: area under the normalised precision curve over 0..0.5.
        precision_auc: area under the precision curve over 0..50 px (`trackingnet` calls this
            its precision).
        average_overlap: mean overlap of the frames with a target.
        success_rate_50: share of frames with an overlap above 0.5.
        success_rate_75: share of frames with an overlap above 0.75.
        success_curve: float64 (21,) at `SUCCESS_THRESHOLDS`.
        precision_curve: float64 (51,) at `PRECISION_THRESHOLDS`.
        normalized_precision_curve: float64 (51,) at `NORMALIZED_PRECISION_THRESHOLDS`.
    """

    protocol: Protocol
    frames: int
    success_auc: float = np.nan
    precision_20: float = np.nan
    normalized_precision_20: float = np.nan
    normalized_precision_auc: float = np.nan
    precision_auc: float = np.nan
    average_overlap: float = np.nan
    success_rate_50: float = np.nan
    success_rate_75: float = np.nan
    success_curve: Floats
    precision_curve: Floats
    normalized_precision_curve: Floats

    def as_dict(self) -> dict[str, float]:
        """The scalar scores by name."""
        return {name: getattr(self, name) for name in SCORE_NAMES}


SCORE_NAMES: Final[tuple[str, ...]] = tuple(one.name for one in fields(Scores) if one.type is float)
"""Names of the scalar scores."""


@dataclass(frozen=True, slots=True, eq=False)
class FrameValues:
    """What was measured of one result, one value a scored row.

    Attributes:
        overlap: float64; NaN where the protocol compares none (no target, or left out) and where
            the result is not a number.
        center_error: pixels, in the same way.
        normalized_center_error: in the same way.
    """

    overlap: Floats
    center_error: Floats
    normalized_center_error: Floats


FrameSource: TypeAlias = FrameValues | Callable[[], FrameValues]
"""The values of the frames, or what computes them once they are asked for."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SequenceScores(Scores):
    """Scores of one result on one sequence.

    Attributes:
        name: of the sequence, where given.
        by_frame: the values of the frames; scores of stored results compute them again from the
            file each time they are asked for, so that many runs need little memory.
        rows: scored rows.
        length_predicted: rows of the result as given.
        length_truth: rows of the ground truth as given.
        invalid_truth: rows of ground truth that are not four finite numbers with w, h > 0.
        bad_results: given rows of the result that are not; rows beyond the ground truth are not
            looked at.
    """

    name: str
    by_frame: FrameSource = field(repr=False)
    rows: int
    length_predicted: int
    length_truth: int
    invalid_truth: int
    bad_results: int

    def frame_values(self) -> FrameValues:
        """Overlap and errors of each scored row.

        Raises:
            BoxFileError: they are those of a file that can no longer be read, or has changed.
        """
        return self.by_frame if isinstance(self.by_frame, FrameValues) else self.by_frame()

    @property
    def overlap(self) -> Floats:
        """Overlap of each scored row; see `frame_values`."""
        return self.frame_values().overlap

    @property
    def center_error(self) -> Floats:
        """Centre error of each scored row in pixels; see `frame_values`."""
        return self.frame_values().center_error

    @property
    def normalized_center_error(self) -> Floats:
        """Normalised centre error of each scored row; see `frame_values`."""
        return self.frame_values().normalized_center_error


def evaluate_boxes(
    predicted: npt.ArrayLike,
    truth: npt.ArrayLike,
    *,
    visible: npt.ArrayLike | None = None,
    protocol: str | Protocol = "pysot",
    on_length: str | None = None,
    name: str = "",
) -> SequenceScores:
    """Score a result against its ground truth under a named protocol.

    What `visible` False means: `pysot` fails the frame in all metrics (the rows its `absent`
    array drops while the divisor stays); so does `lasot`; `pytracking` treats it as a frame
    without target; `got10k-ao` and `strict` leave it out; `otb`, `got10k-ope` and `trackingnet`
    know no such flags and do not look at them.

    Args:
        predicted: (n, 4) boxes x, y, w, h in pixels, one a frame; NaN allowed.
        truth: (n, 4) boxes x, y, w, h in pixels as stored; NaN and zero sizes allowed.
        visible: (n,) True where the target is visible, as long as `truth`.
        protocol: name or `Protocol`.
        on_length: what to do with unequal lengths: "error" refuses, "pad" fails the missing
            rows, "cut" scores the shared rows; None does as the protocol's toolkit.
        name: of the sequence, for the scores and the messages.

    Raises:
        ArrayContract: an array of the wrong shape, no row of truth, or rows that the protocol's
            toolkit refuses.
        LengthMismatch: unequal lengths that are refused; both are named.
        UsageError: unknown protocol or `on_length`.

    Example:
        >>> truth = [[10, 10, 20, 20], [12, 10, 20, 20]]
        >>> evaluate_boxes(truth, truth, protocol="strict").success_auc
        1.0
        >>> round(evaluate_boxes(truth, truth).success_auc, 4)  # 20/21: strict comparison
        0.9524
    """
    chosen, rule = get_protocol(protocol), check_length_rule(on_length)
    try:
        with np.errstate(all="ignore"):
            return _evaluate(predicted, truth, visible, chosen, rule, name)
    except (ArrayContract, LengthMismatch) as error:
        if not name:
            raise
        msg = f"{name}: {error}"
        raise type(error)(msg) from None


def _evaluate(
    predicted: npt.ArrayLike,
    truth: npt.ArrayLike,
    visible: npt.ArrayLike | None,
    protocol: Protocol,
    rule: LengthRule | None,
    name: str,
) -> SequenceScores:
    given, wanted = as_boxes(predicted, "predicted"), as_boxes(truth, "truth")
    if len(wanted) == 0:
        msg = "truth: no rows; there is nothing to score against"
        raise ArrayContract(msg)
    _check_cover(protocol, len(wanted))
    flags = _as_flags(visible, len(wanted))
    aligned, rows, present = align(given, wanted, protocol, rule)
    p, t = aligned.T.copy(), wanted[:rows].T.copy()
    lengths_and_counts: dict[str, Any] = {
        "length_predicted": len(given),
        "length_truth": len(wanted),
        "invalid_truth": rows - count_targets(t),
        "bad_results": present - count_targets(p[:, :present]),
    }
    pair = Pair(p, t, None if flags is None else flags[:rows], present, protocol)
    measured = MEASURES[protocol.name](pair)
    return SequenceScores(
        name=name,
        protocol=protocol,
        frames=measured.frames,
        by_frame=FrameValues(
            measured.overlap,
            _reported(measured.error, rows),
            _reported(measured.normalized, rows),
        ),
        rows=rows,
        **lengths_and_counts,
        **_success_scores(measured, protocol),
        **_precision_scores(measured, protocol),
        **_normalized_scores(measured, protocol),
    )


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


def _reported(error: Floats | None, rows: int) -> Floats:
    """Errors with NaN in place of the mark of frames that pass without a target."""
    if error is None:
        return np.full(rows, np.nan)
    marked = error < 0
    return np.where(marked, np.nan, error) if marked.any() else error


def _divisor(measured: Measured, protocol: Protocol) -> float:
    return measured.frames + (_EPSILON if protocol.name in ("otb", "lasot") else 0.0)


def _success_scores(measured: Measured, protocol: Protocol) -> dict[str, Any]:
    name = protocol.name
    grid = _SUCCESS_GOT10K_AO if name == "got10k-ao" else _SUCCESS
    counts = grid.count_above(measured.overlap, inclusive=name in ("strict", "trackingnet"))
    curve = share(counts, _divisor(measured, protocol))
    scores: dict[str, Any] = {"success_curve": curve}
    if name == "trackingnet":
        scores["success_auc"] = trapezoid(curve)
    elif name != "got10k-ao":
        scores["success_auc"] = mean(curve)
    if name in ("got10k-ao", "got10k-ope", "pytracking"):
        scores["success_rate_50"] = float(curve[10])
    if name in ("got10k-ao", "pytracking"):
        scores["success_rate_75"] = float(curve[15])
        values = measured.overlap[measured.counted]
        scores["average_overlap"] = mean(values)
    return scores


def _precision_scores(measured: Measured, protocol: Protocol) -> dict[str, Any]:
    if measured.error is None:
        return {"precision_curve": np.full(len(PRECISION_THRESHOLDS), np.nan)}
    divisor = _divisor(measured, protocol)
    curve = share(_PRECISION.count_within(measured.error), divisor)
    scores: dict[str, Any] = {"precision_curve": curve, "precision_20": float(curve[20])}
    if protocol.name == "trackingnet":
        own = share(_PRECISION_TRACKINGNET.count_within(measured.error), divisor)
        scores["precision_auc"] = trapezoid(own)
    return scores


def _normalized_scores(measured: Measured, protocol: Protocol) -> dict[str, Any]:
    key = "normalized_precision_curve"
    if measured.normalized is None:
        return {key: np.full(len(NORMALIZED_PRECISION_THRESHOLDS), np.nan)}
    divisor, name = _divisor(measured, protocol), protocol.name
    grid = _NORMALIZED_GOT10K if name == "got10k-ope" else _NORMALIZED
    curve = share(grid.count_within(measured.normalized), divisor)
    area = mean(curve)
    if name == "trackingnet":
        own = share(_NORMALIZED_TRACKINGNET.count_within(measured.normalized), divisor)
        area = trapezoid(own)
    return {
        key: curve,
        "normalized_precision_20": float(curve[20]),
        "normalized_precision_auc": area,
    }
