"""Scores of many sequences as one."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

import numpy as np

from nat2024.errors import UsageError
from nat2024.metrics.protocols import Protocol, get_protocol
from nat2024.metrics.scores import (
    COLUMN,
    CURVE_COLUMNS,
    ROW_LENGTH,
    SCORE_NAMES,
    Scores,
    SequenceScores,
)
from nat2024.types import Flags, Floats

_EPSILON = float(np.finfo(np.float64).eps)
_CURVE_OF: Final = {
    "success_auc": "success_curve",
    "success_rate_50": "success_curve",
    "success_rate_75": "success_curve",
    "average_overlap": "success_curve",
    "precision_20": "precision_curve",
    "precision_auc": "precision_curve",
    "normalized_precision_20": "normalized_precision_curve",
    "normalized_precision_auc": "normalized_precision_curve",
}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class DatasetScores(Scores):
    """Scores of a result on many sequences; `frames` is the sum of theirs.

    Attributes:
        sequences: how many were given.
        scored: how many of them have a success score, so enter its mean.
    """

    sequences: int
    scored: int


def summarize(
    scores: Iterable[SequenceScores], protocol: str | Protocol | None = None
) -> DatasetScores:
    """Average scores over sequences, as the protocol's toolkit does.

    The plain mean over sequences, with these differences: `got10k-ao` pools the frames of all
    sequences; `otb` and `lasot` leave out, metric by metric, sequences whose curve is all zero.
    Sequences without a score (NaN: no counted frame) leave the mean; official code differs: the
    GOT-10k toolkit's mean becomes NaN and pytracking raises.

    A score over an attribute is the same call with the sequences that carry it. Missing sequences
    are the caller's: OTB, LaSOT, pysot and the GOT-10k toolkit fail on them, pytracking fails or
    drops the sequence for all trackers, TrackingNet scores boxes of zeros.

    Args:
        scores: of one result, all under one protocol.
        protocol: needed only where `scores` may be empty.

    Raises:
        UsageError: scores of different protocols, or none and no `protocol`.
    """
    given = list(scores)
    chosen = _common_protocol(given, protocol)
    table = _table(given)
    frames = table[:, COLUMN["frames"]]
    row = np.zeros(ROW_LENGTH)
    weights: dict[str, Floats] = {}
    for name, columns in CURVE_COLUMNS.items():
        weights[name] = _weights(table[:, columns], frames, chosen)
        row[columns] = _mean(table[:, columns], weights[name])
    for name in SCORE_NAMES:
        column = COLUMN[name]
        row[column] = _mean(table[:, column : column + 1], weights[_CURVE_OF[name]])[0]
    row[COLUMN["frames"]] = frames.sum()
    return DatasetScores(
        protocol=chosen,
        row=row,
        sequences=len(given),
        scored=int(np.count_nonzero(weights["success_curve"])),
    )


def mean_success(values: Iterable[float]) -> float:
    """The success score that `summarize` gives under a protocol which takes the plain mean.

    Args:
        values: `success_auc` of the sequences; NaN leaves the mean.
    """
    table = np.array(list(values), dtype=np.float64).reshape(-1, 1)
    return float(_mean(table, np.where(np.isnan(table[:, 0]), 0.0, 1.0))[0])


def sequence_weights(scores: Iterable[SequenceScores], metric: str) -> Floats:
    """The weight of each sequence in the mean of a metric, as `summarize` takes it.

    Args:
        scores: of one result, all under one protocol, at least one.
        metric: name of a scalar score, such as `success_auc`.

    Returns:
        float64, one a sequence; 0 for those that leave the mean.
    """
    given = list(scores)
    table = _table(given)
    curves = table[:, CURVE_COLUMNS[_CURVE_OF[metric]]]
    return _weights(curves, table[:, COLUMN["frames"]], _common_protocol(given, None))


def _common_protocol(given: list[SequenceScores], protocol: str | Protocol | None) -> Protocol:
    found = {one.protocol.without_sequence_data for one in given}
    if protocol is not None:
        found.add(get_protocol(protocol).without_sequence_data)
    if len(found) == 1:
        return found.pop()
    if found:
        titles = ", ".join(sorted(one.title for one in found))
        msg = f"scores of different protocols cannot be averaged: {titles}"
    else:
        msg = "no scores to average; pass the protocol to get empty ones"
    raise UsageError(msg)


def _table(given: list[SequenceScores]) -> Floats:
    """All numbers of all scores, float64 (sequences, `ROW_LENGTH`)."""
    return np.array([one.row for one in given], dtype=np.float64).reshape(len(given), ROW_LENGTH)


def _weights(table: Floats, frames: Floats, protocol: Protocol) -> Floats:
    shares = frames if protocol.name == "got10k-ao" else 1.0
    return np.where(_kept(table, protocol), shares, 0.0)


def _kept(table: Floats, protocol: Protocol) -> Flags:
    """Which sequences enter the mean of the metric with these curves."""
    sums = table.sum(axis=1)
    if protocol.name in ("otb", "lasot"):
        return np.asarray(sums > _EPSILON)
    return np.asarray(~np.isnan(sums))


def _mean(table: Floats, weights: Floats) -> Floats:
    """Weighted mean over the rows of positive weight; NaN where there is none."""
    kept = weights > 0
    if not kept.any():
        return np.full(table.shape[1], np.nan)
    return np.asarray(np.average(table[kept], axis=0, weights=weights[kept]))
