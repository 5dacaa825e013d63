"""The scores of a result; all their numbers are one row of an array, so that many need little."""

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, TypeAlias

import numpy as np

from nat2024.metrics.curves import (
    NORMALIZED_PRECISION_THRESHOLDS,
    PRECISION_THRESHOLDS,
    SUCCESS_THRESHOLDS,
)
from nat2024.metrics.protocols import Protocol
from nat2024.types import Floats

SCORE_NAMES: Final[tuple[str, ...]] = (
    "success_auc",
    "precision_20",
    "normalized_precision_20",
    "normalized_precision_auc",
    "precision_auc",
    "average_overlap",
    "success_rate_50",
    "success_rate_75",
)
"""Names of the scalar scores."""

COUNT_NAMES: Final = (
    "frames",
    "rows",
    "length_predicted",
    "length_truth",
    "invalid_truth",
    "bad_results",
)
"""Names of the whole numbers."""

CURVE_LENGTHS: Final = {
    "success_curve": len(SUCCESS_THRESHOLDS),
    "precision_curve": len(PRECISION_THRESHOLDS),
    "normalized_precision_curve": len(NORMALIZED_PRECISION_THRESHOLDS),
}
"""How many values each curve has."""

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


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Scores:
    """Scores in 0..1 and curves; NaN where the protocol does not define one.

    Attributes:
        protocol: with its options.
        row: float64 (`ROW_LENGTH`,), all numbers; what follows reads them from there.
    """

    protocol: Protocol
    row: Floats

    @property
    def frames(self) -> int:
        """Frames in the divisor."""
        return int(self.row.item(COLUMN["frames"]))

    @property
    def success_auc(self) -> float:
        """Area under the success curve."""
        return float(self.row.item(COLUMN["success_auc"]))

    @property
    def precision_20(self) -> float:
        """Share of frames with a centre error of at most 20 px."""
        return float(self.row.item(COLUMN["precision_20"]))

    @property
    def normalized_precision_20(self) -> float:
        """Share of frames with a normalised centre error of at most 0.20."""
        return float(self.row.item(COLUMN["normalized_precision_20"]))

    @property
    def normalized_precision_auc(self) -> float:
        """Area under the normalised precision curve over 0..0.5."""
        return float(self.row.item(COLUMN["normalized_precision_auc"]))

    @property
    def precision_auc(self) -> float:
        """Area under the precision curve over 0..50 px (precision in `trackingnet`)."""
        return float(self.row.item(COLUMN["precision_auc"]))

    @property
    def average_overlap(self) -> float:
        """Mean overlap of the frames with a target."""
        return float(self.row.item(COLUMN["average_overlap"]))

    @property
    def success_rate_50(self) -> float:
        """Share of frames with an overlap above 0.5."""
        return float(self.row.item(COLUMN["success_rate_50"]))

    @property
    def success_rate_75(self) -> float:
        """Share of frames with an overlap above 0.75."""
        return float(self.row.item(COLUMN["success_rate_75"]))

    @property
    def success_curve(self) -> Floats:
        """Float64 (21,) at `SUCCESS_THRESHOLDS`."""
        return self.row[CURVE_COLUMNS["success_curve"]]

    @property
    def precision_curve(self) -> Floats:
        """Float64 (51,) at `PRECISION_THRESHOLDS`."""
        return self.row[CURVE_COLUMNS["precision_curve"]]

    @property
    def normalized_precision_curve(self) -> Floats:
        """Float64 (51,) at `NORMALIZED_PRECISION_THRESHOLDS`."""
        return self.row[CURVE_COLUMNS["normalized_precision_curve"]]

    def as_dict(self) -> dict[str, float]:
        """The scalar scores by name."""
        return {name: self.row.item(COLUMN[name]) for name in SCORE_NAMES}

    def __repr__(self) -> str:
        """The protocol, the number of frames and the scores that it defines."""
        known = {name: value for name, value in self.as_dict().items() if value == value}
        numbers = "".join(f", {name}={value:.6g}" for name, value in known.items())
        return f"{type(self).__name__}({self.protocol.title}, frames={self.frames}{numbers})"


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


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class SequenceScores(Scores):
    """Scores of one result on one sequence.

    Attributes:
        name: of the sequence, where given.
        by_frame: the values of the frames; scores of stored results compute them again from the
            file each time they are asked for, so that many runs need little memory.
    """

    name: str
    by_frame: FrameSource

    @property
    def rows(self) -> int:
        """Scored rows."""
        return int(self.row.item(COLUMN["rows"]))

    @property
    def length_predicted(self) -> int:
        """Rows of the result as given."""
        return int(self.row.item(COLUMN["length_predicted"]))

    @property
    def length_truth(self) -> int:
        """Rows of the ground truth as given."""
        return int(self.row.item(COLUMN["length_truth"]))

    @property
    def invalid_truth(self) -> int:
        """Rows of ground truth that are not four finite numbers with w, h > 0."""
        return int(self.row.item(COLUMN["invalid_truth"]))

    @property
    def bad_results(self) -> int:
        """Given rows of the result that are not; those beyond the truth do not count."""
        return int(self.row.item(COLUMN["bad_results"]))

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
