"""The scores of one result on one sequence, and all their numbers as one row."""

import itertools
from collections.abc import Callable
from dataclasses import dataclass, field, fields
from typing import Any, Final, TypeAlias

import numpy as np

from nat2024.metrics.curves import (
    NORMALIZED_PRECISION_THRESHOLDS,
    PRECISION_THRESHOLDS,
    SUCCESS_THRESHOLDS,
)
from nat2024.metrics.protocols import Protocol
from nat2024.types import Floats


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


CURVE_LENGTHS: Final = {
    "success_curve": len(SUCCESS_THRESHOLDS),
    "precision_curve": len(PRECISION_THRESHOLDS),
    "normalized_precision_curve": len(NORMALIZED_PRECISION_THRESHOLDS),
}
"""How many values each curve has."""

COUNT_NAMES: Final = (
    "frames",
    "rows",
    "length_predicted",
    "length_truth",
    "invalid_truth",
    "bad_results",
)
"""Names of the whole numbers."""

_SINGLE: Final = (*COUNT_NAMES, *SCORE_NAMES)
_ENDS: Final = [len(_SINGLE), *(len(_SINGLE) + np.cumsum([*CURVE_LENGTHS.values()])).tolist()]

COLUMN: Final = {name: number for number, name in enumerate(_SINGLE)}
"""Where each single number is in a row of `ROW_LENGTH`."""

CURVE_COLUMNS: Final = {
    name: slice(*ends) for name, ends in zip(CURVE_LENGTHS, itertools.pairwise(_ENDS), strict=True)
}
"""Where each curve is."""

ROW_LENGTH: Final[int] = _ENDS[-1]
"""How many numbers there are of one result on one sequence, those of its frames left out."""


def scores_of_row(
    row: Floats, *, name: str, protocol: Protocol, by_frame: FrameSource
) -> SequenceScores:
    """Scores whose numbers are those of a row, float64 (`ROW_LENGTH`,); curves are views of it."""
    single = row[: len(_SINGLE)].tolist()
    counts: dict[str, Any] = dict(zip(COUNT_NAMES, map(int, single), strict=False))
    scores: dict[str, Any] = dict(zip(SCORE_NAMES, single[len(COUNT_NAMES) :], strict=True))
    curves: dict[str, Any] = {curve: row[columns] for curve, columns in CURVE_COLUMNS.items()}
    return SequenceScores(
        name=name, protocol=protocol, by_frame=by_frame, **counts, **scores, **curves
    )
