"""When and how a tracker lost its target, from overlap and centre error alone.

A target is *lost* in a frame that lies in a run of at least `loss_frames` consecutive frames with
an overlap of 0. Consecutive means among the frames whose truth is known: frames without a target
or without annotation neither count nor break a run.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from nat2024.errors import ArrayContract, LengthMismatch, UsageError
from nat2024.types import Flags, Floats

LOSS_FRAMES = 10
"""So many frames without overlap in a row are a loss: at 30 frames a second a third of one."""

DRIFT_FRAMES = 20
"""So many frames before a loss tell how the tracker came to it."""


@dataclass(frozen=True, slots=True)
class Failure:
    """How one run lost the target of one sequence, if it did.

    Attributes:
        frames: frames that count, those whose truth is known.
        absent: frames that do not: no target, or no annotation.
        first_loss: row of the first frame of the first loss, None where the target is never lost.
        losses: number of losses.
        lost: frames in losses.
        recoveries: losses after which the boxes overlap again.
        drift: growth of the centre error in pixels a frame over the `drift_frames` counted frames
            before the first loss, by least squares; NaN without a loss or with fewer than two
            known errors. Slow drift is small, a jump to something else is large.
        longest: counted frames in the longest span without a loss.
        longest_start: row of its first frame, -1 where there is none.
    """

    frames: int
    absent: int
    first_loss: int | None
    losses: int
    lost: int
    recoveries: int
    drift: float
    longest: int
    longest_start: int


def find_failure(
    overlap: npt.ArrayLike,
    center_error: npt.ArrayLike,
    *,
    loss_frames: int = LOSS_FRAMES,
    drift_frames: int = DRIFT_FRAMES,
) -> Failure:
    """Find the losses of one run on one sequence.

    Args:
        overlap: (n,) in 0..1, NaN where the truth is not known. A frame in which the tracker gave
            no usable box has the overlap 0.
        center_error: (n,) pixels, NaN where not known.
        loss_frames: frames of overlap 0 in a row that make a loss.
        drift_frames: frames before the first loss over which `drift` is measured.

    Raises:
        ArrayContract, LengthMismatch: the arrays are not of one dimension and one length.
        UsageError: a number of frames is too small.

    Example:
        >>> found = find_failure([1, 0.5, 0, 0, 0, 0.4], [0, 4, 8, 9, 9, 5], loss_frames=3)
        >>> found.first_loss, found.lost, found.recoveries, found.drift
        (2, 3, 1, 4.0)
    """
    values, errors = _checked(overlap, center_error)
    if loss_frames < 1 or drift_frames < 2:
        msg = "a loss takes at least 1 frame (loss_frames), and drift at least 2 (drift_frames)"
        raise UsageError(msg)
    rows = np.flatnonzero(~np.isnan(values))
    starts, ends = _losses(values[rows] <= 0, loss_frames)
    longest_start, longest = _longest_span(starts, ends, len(rows))
    first = int(starts[0]) if len(starts) else None
    return Failure(
        frames=len(rows),
        absent=len(values) - len(rows),
        first_loss=None if first is None else int(rows[first]),
        losses=len(starts),
        lost=int((ends - starts).sum()),
        recoveries=int(np.count_nonzero(ends < len(rows))),
        drift=np.nan if first is None else _drift(rows, errors, first, drift_frames),
        longest=longest,
        longest_start=int(rows[longest_start]) if longest else -1,
    )


def lost_frames(overlap: npt.ArrayLike, *, loss_frames: int = LOSS_FRAMES) -> Flags:
    """Which rows lie in a loss, bool (n,); see `find_failure`."""
    values, _ = _checked(overlap, overlap)
    rows = np.flatnonzero(~np.isnan(values))
    flags = np.zeros(len(values), dtype=np.bool_)
    for start, end in zip(*_losses(values[rows] <= 0, loss_frames), strict=True):
        flags[rows[start:end]] = True
    return flags


def _checked(overlap: npt.ArrayLike, center_error: npt.ArrayLike) -> tuple[Floats, Floats]:
    values = np.asarray(overlap, dtype=np.float64)
    errors = np.asarray(center_error, dtype=np.float64)
    if values.ndim != 1 or errors.ndim != 1:
        msg = f"overlap and centre error must have the shape (n,), not {values.shape}"
        raise ArrayContract(msg)
    if len(values) != len(errors):
        msg = f"{len(values)} overlaps, but {len(errors)} centre errors"
        raise LengthMismatch(msg)
    return values, errors


def _losses(missed: Flags, loss_frames: int) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]:
    """Starts and ends (one past the last) of runs of True that are long enough."""
    edges = np.diff(np.pad(missed.astype(np.int8), 1))
    starts, ends = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
    long = ends - starts >= loss_frames
    return starts[long], ends[long]


def _longest_span(
    starts: npt.NDArray[np.intp], ends: npt.NDArray[np.intp], count: int
) -> tuple[int, int]:
    begins, stops = np.append(0, ends), np.append(starts, count)
    lengths = stops - begins
    best = int(lengths.argmax())
    return int(begins[best]), int(lengths[best])


def _drift(rows: npt.NDArray[np.intp], errors: Floats, first: int, drift_frames: int) -> float:
    before = rows[max(0, first - drift_frames) : first]
    known = before[np.isfinite(errors[before])]
    if len(known) < 2:
        return float("nan")
    frames = known - known.mean()
    return float((frames * errors[known]).sum() / (frames**2).sum())
