"""Scores of repeated runs of one tracker on one sequence, as one."""

from collections.abc import Sequence
from dataclasses import fields, replace
from functools import partial

import numpy as np

from nat2024.errors import ArrayContract
from nat2024.metrics.scores import (
    COLUMN,
    CURVE_COLUMNS,
    SCORE_NAMES,
    FrameSource,
    FrameValues,
    SequenceScores,
)
from nat2024.types import Floats


def average_repeats(repeats: Sequence[SequenceScores]) -> SequenceScores:
    """Average scores and curves over repeats, as pytracking merges its runs.

    Overlap and errors by frame are averaged over the repeats that have them, where all repeats
    count the same frames; else they are those of the first. Bad rows are added up.

    Args:
        repeats: scores of the same sequence under the same protocol, at least one.

    Raises:
        ArrayContract: there are none.
    """
    if not repeats:
        msg = "no repeats to average"
        raise ArrayContract(msg)
    first = repeats[0]
    if len(repeats) == 1:
        return first
    sources = tuple(one.by_frame for one in repeats)
    later = partial(_average_frames, sources)
    at_hand = all(isinstance(source, FrameValues) for source in sources)
    row = first.row.copy()
    for name in SCORE_NAMES:
        row[COLUMN[name]] = np.mean([getattr(one, name) for one in repeats])
    for columns in CURVE_COLUMNS.values():
        row[columns] = np.mean([one.row[columns] for one in repeats], axis=0)
    row[COLUMN["bad_results"]] = sum(one.bad_results for one in repeats)
    return replace(first, row=row, by_frame=later() if at_hand else later)


def _average_frames(sources: tuple[FrameSource, ...]) -> FrameValues:
    values = [one if isinstance(one, FrameValues) else one() for one in sources]
    return FrameValues(
        *(_by_frame([getattr(one, f.name) for one in values]) for f in fields(FrameValues))
    )


def _by_frame(values: list[Floats]) -> Floats:
    if len({len(one) for one in values}) > 1:
        return values[0]
    table = np.stack(values)
    is_there = ~np.isnan(table)
    count = is_there.sum(axis=0)
    total = np.where(is_there, table, 0).sum(axis=0)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)
