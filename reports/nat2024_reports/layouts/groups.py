"""Runs against attributes, or against categories of targets."""

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Literal

from nat2024_reports.layouts.scores import (
    NO_GAIN,
    PLAIN,
    SCORES,
    Gain,
    caption,
    check_one,
    doubts,
    facts,
    for_programs,
    gain_cells,
    gain_columns,
    gain_of,
    in_order,
    names_of,
)
from nat2024_reports.tables import Column, Row, Table, ranks, score, words

if TYPE_CHECKING:
    import pandas as pd

_COMPUTED = "*"


def groups_table(
    summary: "pd.DataFrame",
    scores: "pd.DataFrame",
    by: Literal["attribute", "category"],
    gains: "pd.DataFrame | None" = None,
    *,
    metric: str = "success_auc",
    intervals: bool = False,
) -> Table:
    """One row a run, one column a group of sequences, the number of sequences in its heading.

    Args:
        summary: rows of `Evaluation.summary()` of one dataset and protocol.
        scores: rows of `Evaluation.per_attribute()` or `.per_category()`.
        by: which of both.
        gains: rows of `Evaluation.gains(by=by)`.
        metric: the score that is shown.
        intervals: show gains with their intervals beside each score.

    Raises:
        ValueError: there are no groups, or several datasets or protocols.
    """
    check_one(summary, "dataset", "protocol")
    if scores.empty:
        msg = f"no sequence has {'an attribute' if by == 'attribute' else 'a category'}"
        raise ValueError(msg)
    sizes = {str(group): int(rows.sequences.max()) for group, rows in scores.groupby(by)}
    groups = list(dict.fromkeys(scores[by].astype(str)))
    computed = _computed(scores) if by == "attribute" else set()
    columns = [Column(heading, is_words=True) for heading in ("Tracker", "Enhancer")]
    columns.append(Column(f"all ({summary.sequences.max()})", "all"))
    found = _gains(gains, by, metric)
    intervals = intervals and bool(found)
    for group in groups:
        mark = _COMPUTED if group in computed else ""
        columns.append(Column(f"{group}{mark} ({sizes[group]})", group, part=group))
        beside = gain_columns(group, intervals=intervals)
        # gains of groups are for those who ask for intervals, and for programs
        columns += beside if intervals else for_programs(beside)
    values = {(r["run"], str(r[by])): r for r in scores.to_dict(orient="records")}
    body = _body(summary, groups, values, found, metric, intervals=intervals)
    shown = next(one.heading for one in SCORES if one.name == metric)
    notes = [f"{_COMPUTED} computed from boxes and frames, not published"] if computed else []
    notes += _small(sizes) + _incomplete(sizes, values)
    notes += doubts(found.values()) if intervals else []
    return Table(
        f"{shown} on {caption(summary)}", tuple(columns), body, tuple(notes), facts(summary)
    )


def _computed(scores: "pd.DataFrame") -> set[str]:
    return {
        str(row["attribute"])
        for row in scores.to_dict(orient="records")
        if row["provenance"] in ("computed", "mixed")
    }


def _gains(gains: "pd.DataFrame | None", by: str, metric: str) -> dict[tuple[str, str], Gain]:
    if gains is None:
        return {}
    rows = gains[gains.metric == metric].to_dict(orient="records")
    return {(row["run"], str(row[by])): gain_of(row) for row in rows}


def _body(
    summary: "pd.DataFrame",
    groups: list[str],
    values: Mapping[tuple[str, str], Mapping[Any, Any]],
    gains: Mapping[tuple[str, str], Gain],
    metric: str,
    *,
    intervals: bool,
) -> tuple[tuple[Row, ...], ...]:
    ordered = in_order(summary)
    runs = [run for group in ordered for run in group]

    def value(run: Mapping[Any, Any], group: str) -> float:
        row = values.get((run["run"], group), {}) if group else run
        return float(row.get(metric, math.nan))

    placed = {}  # by group, "" for all sequences
    for group in ("", *groups):
        places = ranks([value(run, group) for run in runs])
        placed[group] = {run["run"]: rank for run, rank in zip(runs, places, strict=True)}

    def line(run: Mapping[Any, Any]) -> Row:
        name, enhancer = run["run"], "-" if run["enhancer"] == PLAIN else run["enhancer"]
        cells = [words(run["tracker"]), words(enhancer), score(value(run, ""), placed[""][name])]
        for group in groups:
            cells.append(score(value(run, group), placed[group][name]))
            cells += gain_cells(gains.get((name, group), NO_GAIN), intervals=intervals)
        return tuple(cells)

    return tuple(tuple(line(run) for run in rows) for rows in ordered)


def _small(sizes: Mapping[str, int]) -> list[str]:
    single = [group for group, count in sizes.items() if count == 1]
    return [f"{names_of(single)}: one sequence only"] if single else []


def _incomplete(
    sizes: Mapping[str, int], values: Mapping[tuple[str, str], Mapping[Any, Any]]
) -> list[str]:
    runs = {run for (run, group), row in values.items() if row["sequences"] < sizes[group]}
    return [f"not all sequences of every column: {names_of(sorted(runs))}"] if runs else []
