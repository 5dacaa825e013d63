"""Sequences against runs."""

import math
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from nat2024_reports.layouts.scores import (
    PLAIN,
    SCORES,
    UNKNOWN_SCOPE,
    caption,
    check_one,
    facts,
    in_order,
)
from nat2024_reports.tables import Column, Row, Table, number, ranks, score, words

if TYPE_CHECKING:
    import pandas as pd


def sequences_table(
    summary: "pd.DataFrame", scores: "pd.DataFrame", *, metric: str = "success_auc"
) -> Table:
    """One row a sequence, one column a run; the best run of each sequence is marked.

    Args:
        summary: rows of `Evaluation.summary()` of one dataset and protocol.
        scores: rows of `Evaluation.per_sequence()`.
        metric: the score that is shown.

    Raises:
        ValueError: it is empty, or mixes datasets or protocols.
    """
    check_one(summary, "dataset", "protocol")
    runs = [run for group in in_order(summary) for run in group]
    found = {(r["run"], r["sequence"]): r for r in scores.to_dict(orient="records")}
    frames = {str(r["sequence"]): int(r["frames"]) for r in found.values()}

    def value(run: str, sequence: str) -> float:
        return float(found[run, sequence][metric]) if (run, sequence) in found else math.nan

    def row(title: str, count: float, values: list[float]) -> Row:
        places = ranks(values)
        cells = (score(one, rank) for one, rank in zip(values, places, strict=True))
        return (words(title), number(count, ".0f"), *cells)

    rows = [
        row(sequence, frames[sequence], [value(run["run"], sequence) for run in runs])
        for sequence in sorted(frames, key=_natural)
    ]
    mean = row("mean", float(summary.frames.max()), [float(run[metric]) for run in runs])
    columns = [Column("Sequence", is_words=True), Column("Frames")]
    headings = _headings(runs)
    columns += [Column(headings[run["run"]], str(run["run"])) for run in runs]
    shown = next(one.heading for one in SCORES if one.name == metric)
    lacking = sorted({headings[r["run"]] for r in runs if r["sequences"] < len(frames)})
    notes = [f"- no result; the mean of {', '.join(lacking)} is over fewer sequences"]
    return Table(
        f"{shown} on {caption(summary)}",
        tuple(columns),
        (tuple(rows), (mean,)),
        tuple(notes if lacking else ()),
        facts(summary),
    )


def _headings(runs: Sequence[Mapping[Any, Any]]) -> dict[str, str]:
    """Tracker and enhancer by run, the scope where two would be alike, else the run's own name."""

    def heading(run: Mapping[Any, Any], *, scope: bool) -> str:
        parts = [run["tracker"]] if run["enhancer"] == PLAIN else [run["tracker"], run["enhancer"]]
        return " +".join(map(str, parts)) + (f" ({run['scope'] or UNKNOWN_SCOPE})" if scope else "")

    found = {run["run"]: heading(run, scope=False) for run in runs}
    for scope in (True, False):
        count = Counter(found.values())
        for run in runs:
            if count[found[run["run"]]] > 1:
                own = heading(run, scope=True) if scope else str(run["run"]).replace("+", " +")
                found[run["run"]] = own
    return found


def _natural(name: str) -> tuple[list[str | int], str]:
    """Sorts `bike2` before `bike10`."""
    parts = re.split(r"(\d+)", name.lower())  # words and numbers take turns
    return [int(part) if part.isdecimal() else part for part in parts], name
