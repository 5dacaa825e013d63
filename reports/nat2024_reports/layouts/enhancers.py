"""Enhancers before one tracker, as in the reference paper's Table IV."""

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from nat2024_reports.layouts.scores import (
    NO_GAIN,
    PLAIN,
    Score,
    caption,
    check_one,
    comparable,
    comparisons,
    defined_scores,
    doubts,
    facts,
    gain_cells,
    gain_columns,
    gains_by_run,
    scope_of,
)
from nat2024_reports.tables import MISSING, Cell, Column, Row, Table, ranks, score, words

if TYPE_CHECKING:
    import pandas as pd

_HEADINGS = {"success_auc": "Succ.", "precision_20": "Prec.", "average_overlap": "AO"}


def enhancers_tables(
    summary: "pd.DataFrame",
    gains: "pd.DataFrame | None" = None,
    *,
    names: Mapping[str, str] | None = None,
    intervals: bool = False,
) -> list[Table]:
    """One table a tracker and scope: the tracker alone, then enhancers from worst to best.

    Args:
        summary: rows of `Evaluation.summary()` of one dataset and protocol.
        gains: rows of `Evaluation.gains()`, which tell how sure a gain is.
        names: of trackers and enhancers as readers know them, such as `SiamRPN++`.
        intervals: show the interval of each gain and the share of sequences that get better.

    Raises:
        ValueError: it is empty, or mixes datasets or protocols.
    """
    check_one(summary, "dataset", "protocol")
    return [_one(runs, gains, names or {}, intervals=intervals) for runs in comparable(summary)]


def _one(
    runs: "pd.DataFrame",
    gains: "pd.DataFrame | None",
    names: Mapping[str, str],
    *,
    intervals: bool,
) -> Table:
    scores = [
        replace(one, heading=_HEADINGS[one.name])
        for one in defined_scores(runs)
        if one.name in _HEADINGS
    ]
    mine = gains[gains.run.isin(runs.run)] if gains is not None else None
    found = gains_by_run(runs, mine)
    columns = [Column("Enhancer", is_words=True)]
    for one in scores:
        columns.append(Column(one.heading, part=one.heading))
        columns += gain_columns(one.heading, intervals=intervals)
    plain = runs[runs.enhancer == PLAIN].to_dict(orient="records")
    enhanced = runs[runs.enhancer != PLAIN].sort_values([*(one.name for one in scores), "run"])
    order: list[dict[Any, Any]] = plain + enhanced.to_dict(orient="records")
    placed = _places(order, scores)
    rows: list[Row] = []
    for position, run in enumerate(order):
        cells = [words(_name(run, names))]
        for one in scores:
            rank = placed[one.name][position]
            gain = found.get((run["run"], one.name), NO_GAIN)
            cells += [score(float(run[one.name]), rank)]
            cells += _gains(gain_cells(gain, intervals=intervals, rank=rank))
        rows.append(tuple(cells))
    tracker = str(runs.tracker.iloc[0])
    groups = (tuple(rows[: len(plain)]), tuple(rows[len(plain) :]))
    return Table(
        f"Enhancers before {names.get(tracker, tracker)} on {caption(runs)}{scope_of(runs)}",
        tuple(columns),
        tuple(group for group in groups if group),
        tuple(doubts(found.values()) + comparisons(runs, found)),
        {**facts(runs), "Tracker": tracker},
    )


def _places(runs: list[dict[Any, Any]], scores: list[Score]) -> dict[str, list[int]]:
    return {one.name: ranks([float(run[one.name]) for run in runs]) for one in scores}


def _gains(cells: list[Cell]) -> list[Cell]:
    """A dash instead of nothing, as the paper's table has it."""
    first, *others = cells
    return [first if first.text else replace(first, text=MISSING, rank=0), *others]


def _name(run: Mapping[Any, Any], names: Mapping[str, str]) -> str:
    if run["enhancer"] == PLAIN:
        return names.get(run["tracker"], run["tracker"])
    return f"+{names.get(run['enhancer'], run['enhancer'])}"
