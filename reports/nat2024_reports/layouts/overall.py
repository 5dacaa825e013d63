"""Trackers and their enhancers with all scores."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from nat2024_reports.layouts.scores import (
    NO_GAIN,
    PLAIN,
    UNKNOWN_SCOPE,
    Gain,
    Score,
    caption,
    check_one,
    comparisons,
    defined_scores,
    doubts,
    facts,
    for_programs,
    gain_cells,
    gain_columns,
    gains_by_run,
    in_order,
    scope_of,
)
from nat2024_reports.tables import Cell, Column, Row, Table, ranks, score, words

if TYPE_CHECKING:
    import pandas as pd


def overall_table(
    summary: "pd.DataFrame", gains: "pd.DataFrame | None" = None, *, intervals: bool = False
) -> Table:
    """Trackers and their enhancers with scores and gains.

    Best and second are told among the runs of one tracker and scope.

    Args:
        summary: rows of `Evaluation.summary()` of one dataset and protocol.
        gains: rows of `Evaluation.gains()`, which tell how sure a gain is.
        intervals: show the interval of each gain and the share of sequences that get better.

    Raises:
        ValueError: it is empty, or mixes datasets or protocols.
    """
    check_one(summary, "dataset", "protocol")
    scores = defined_scores(summary)
    found = gains_by_run(summary, gains)
    intervals = intervals and bool(found)
    columns = [Column(heading, is_words=True) for heading in ("Tracker", "Enhancer")]
    # one scope of all is said once, in the caption
    several = len(set(summary.scope[summary.enhancer != PLAIN])) > 1
    columns.append(Column("Scope", is_words=True, where="all" if several else "file"))
    for one in scores:
        columns.append(Column(one.heading, part=one.heading))
        if one.gain:
            beside = gain_columns(one.heading, intervals=intervals)
            columns += beside if found else for_programs(beside)
    groups = [_rows(group, scores, found, intervals=intervals) for group in in_order(summary)]
    return Table(
        caption(summary) + scope_of(summary),
        tuple(columns),
        tuple(groups),
        tuple(doubts(found.values()) + comparisons(summary, found)),
        facts(summary),
    )


def _rows(
    runs: list[dict[Any, Any]],
    scores: list[Score],
    gains: Mapping[tuple[str, str], Gain],
    *,
    intervals: bool,
) -> tuple[Row, ...]:
    placed = {one.name: ranks([float(run[one.name]) for run in runs]) for one in scores}
    rows = []
    for position, run in enumerate(runs):
        plain = run["enhancer"] == PLAIN
        scope = "" if plain else run["scope"] or UNKNOWN_SCOPE
        names = (run["tracker"], "-" if plain else run["enhancer"], scope)
        cells: list[Cell] = [words(name) for name in names]
        for one in scores:
            cells.append(score(float(run[one.name]), placed[one.name][position]))
            if one.gain:
                gain = gains.get((run["run"], one.name), NO_GAIN)
                cells += gain_cells(gain, intervals=intervals)
        rows.append(tuple(cells))
    return tuple(rows)
