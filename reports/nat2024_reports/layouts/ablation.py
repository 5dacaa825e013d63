"""Parts of an enhancer taken away, as in the reference paper's Table V."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from nat2024_reports.layouts.scores import (
    NO_GAIN,
    PLAIN,
    Gain,
    caption,
    check_one,
    comparisons,
    defined_scores,
    doubts,
    facts,
    gain_cells,
    gain_columns,
    gains_by_run,
    scope_of,
)
from nat2024_reports.tables import MISSING, Cell, Column, Row, Table, number, ranks, words

if TYPE_CHECKING:
    import pandas as pd

_HEADINGS = {
    "success_auc": ("Succ.", "Δₛ (%)"),
    "precision_20": ("Prec.", "Δₚ (%)"),
    "average_overlap": ("AO", "Δ (%)"),
}


@dataclass(frozen=True, slots=True)
class Ablation:
    """Which runs are variants of one enhancer.

    Attributes:
        enhancer: its name as readers know it, which the whole one is called by.
        names: of all variants, the whole enhancer last, such as `+Baseline+TB`.
        variants: name of the variant, by run.
    """

    enhancer: str
    names: Sequence[str]
    variants: Mapping[str, str]

    def is_told_by(self, runs: Iterable[str]) -> bool:
        """Whether these runs hold a variant that is not the whole enhancer."""
        found = {self.variants[run] for run in runs if run in self.variants}
        return bool(found - {self.names[-1]})


def ablation_table(
    summary: "pd.DataFrame",
    ablation: Ablation,
    gains: "pd.DataFrame | None" = None,
    *,
    names: Mapping[str, str] | None = None,
    intervals: bool = False,
) -> Table:
    """The tracker alone, then every variant; several runs of one variant are seeds.

    With several seeds scores are means, with the sample standard deviation over the seeds.

    Args:
        summary: rows of `Evaluation.summary()` of one dataset, protocol and tracker; runs that
            are no variants are left out.
        ablation: which runs are variants.
        gains: rows of `Evaluation.gains()`, which tell how sure a gain is.
        names: of trackers as readers know them, such as `SiamRPN++`.
        intervals: show the interval of each gain, of the mean where there are several seeds.

    Raises:
        ValueError: it is empty, or mixes datasets, protocols or trackers.
    """
    is_part = (summary.enhancer == PLAIN) | summary.run.isin(list(ablation.variants))
    summary = summary[is_part]
    check_one(summary, "dataset", "protocol", "tracker")
    scores = [one.name for one in defined_scores(summary) if one.name in _HEADINGS]
    found = gains_by_run(summary, gains)
    plain = summary[summary.enhancer == PLAIN]
    by_variant = {
        name: summary[[ablation.variants.get(run) == name for run in summary.run]]
        for name in ablation.names
    }
    told = {name: runs for name, runs in by_variant.items() if len(runs)}
    rows = [plain, *told.values()] if len(plain) else list(told.values())
    spread = any(len(runs) > 1 for runs in told.values())
    columns = [Column("Tracker", is_words=True)]
    if spread:
        columns.append(Column("Seeds"))
    for one in scores:
        heading, delta = _HEADINGS[one]
        columns.append(Column(heading, part=heading))
        columns.append(Column("", f"{heading} deviation", where="file"))
        columns += gain_columns(heading, intervals=intervals, heading=delta)
    cells = _cells(rows, scores, found, intervals=intervals)
    tracker = str(summary.tracker.iloc[0])
    texts = [_title(name, ablation) for name in told]
    titles = [(names or {}).get(tracker, tracker), *texts] if len(plain) else texts
    body = [
        (words(title), *([number(len(runs), "d")] if spread else []), *line)
        for title, runs, line in zip(titles, rows, cells, strict=True)
    ]
    used = summary[summary.enhancer != PLAIN]
    shown = [gain for (run, _), gain in found.items() if run in set(used.run)]
    notes = doubts(shown) + comparisons(summary, found)
    if spread:
        notes.append("± sample standard deviation over seeds: a smaller gain is none")
    if missing := [name for name in ablation.names if name not in told]:
        notes.append(f"no run of {', '.join(missing)}")
    return Table(
        f"Ablation of {ablation.enhancer} on {caption(summary)}{scope_of(summary)}",
        tuple(columns),
        _grouped(body, has_plain=len(plain) > 0),
        tuple(notes),
        {**facts(summary), "Of": tracker},
    )


def _title(name: str, ablation: Ablation) -> str:
    return f"{name} ({ablation.enhancer})" if name == ablation.names[-1] else name


def _grouped(rows: Sequence[Row], *, has_plain: bool) -> tuple[tuple[Row, ...], ...]:
    first = 1 if has_plain else 0
    groups = (tuple(rows[:first]), tuple(rows[first:]))
    return tuple(group for group in groups if group)


def _cells(
    rows: "Sequence[pd.DataFrame]",
    scores: Sequence[str],
    gains: Mapping[tuple[str, str], Gain],
    *,
    intervals: bool,
) -> list[list[Cell]]:
    lines: list[list[Cell]] = [[] for _ in rows]
    for one in scores:
        tables = [runs[one].to_numpy(float) for runs in rows]
        places = ranks([float(np.mean(values)) for values in tables])
        for line, runs, values, rank in zip(lines, rows, tables, places, strict=True):
            deviation = float(np.std(values, ddof=1)) if len(values) > 1 else math.nan
            mean = float(np.mean(values))
            text = MISSING if math.isnan(mean) else f"{mean:.3f}" + _after(deviation, ".3f")
            line += [Cell(text, mean, rank), Cell("", deviation)]
            line += _gain_cells(runs, one, gains, rank, intervals=intervals)
    return lines


def _gain_cells(
    runs: "pd.DataFrame",
    score: str,
    gains: Mapping[tuple[str, str], Gain],
    rank: int,
    *,
    intervals: bool,
) -> list[Cell]:
    found = [gain for run in runs.run if (gain := gains.get((run, score)))]
    if len(found) < len(runs) or not found:
        cells = gain_cells(NO_GAIN, intervals=intervals)
        return [Cell("-", math.nan), *cells[1:]]
    cells = gain_cells(_mean(found), intervals=intervals and len(found) == 1, rank=rank)
    if len(found) > 1:
        deviation = float(np.std([gain.percent for gain in found], ddof=1))
        first: Any = cells[0]
        spread = Cell(first.text + _after(deviation, ".3f"), first.value, rank, first.is_doubtful)
        cells = [spread, *([Cell("")] if intervals else []), *cells[1:]]
    return cells


def _mean(gains: Sequence[Gain]) -> Gain:
    """The mean over seeds; certain only where every seed is, its interval not known."""
    if len(gains) == 1:
        return gains[0]
    known = [gain.certain for gain in gains]
    return Gain(
        percent=float(np.mean([gain.percent for gain in gains])),
        improved=float(np.mean([gain.improved for gain in gains])),
        sequences=min(gain.sequences for gain in gains),
        certain=None if None in known else all(known),
    )


def _after(deviation: float, form: str) -> str:
    return "" if math.isnan(deviation) else f" ±{deviation:{form}}"
