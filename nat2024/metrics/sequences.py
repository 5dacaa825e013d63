"""Scores of one result on one sequence."""

import numpy as np
import numpy.typing as npt

from nat2024.errors import ArrayContract, LengthMismatch
from nat2024.metrics.batches import aligned, measure_rows, pair_of
from nat2024.metrics.protocols import LengthRule, Protocol, check_length_rule, get_protocol
from nat2024.metrics.scores import FrameValues, SequenceScores
from nat2024.types import Floats


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
    given = [aligned(predicted, truth, visible, protocol, rule)]
    rows, measured = measure_rows(given, pair_of(given, protocol))
    length = len(given[0].truth)
    frames = FrameValues(
        measured.overlap,
        _reported(measured.error, length),
        _reported(measured.normalized, length),
    )
    return SequenceScores(name=name, protocol=protocol, by_frame=frames, row=rows[0])


def _reported(error: Floats | None, rows: int) -> Floats:
    """Errors with NaN in place of the mark of frames that pass without a target."""
    if error is None:
        return np.full(rows, np.nan)
    marked = error < 0
    return np.where(marked, np.nan, error) if marked.any() else error
