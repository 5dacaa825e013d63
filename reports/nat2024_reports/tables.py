"""Score tables: what stands in them, whatever format they are written in.

Columns and gains follow the reference paper's Table IV: scores with three decimals, gains in
percent of the tracker alone with three decimals, the best of a column bold and the second
underlined. Best and second are told among the runs of one tracker, and enhancement scopes are
never mixed in one comparison.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

from nat2024_reports.gains import relative_gain

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, slots=True)
class Column:
    """One score: its name in a summary, its heading, and whether its gain is shown beside it."""

    name: str
    heading: str
    gain: bool


COLUMNS = (
    Column("success_auc", "Success", gain=True),
    Column("precision_20", "Precision", gain=True),
    Column("normalized_precision_20", "Norm. prec.", gain=True),
    Column("normalized_precision_auc", "Norm. prec. AUC", gain=False),
    Column("average_overlap", "Average overlap", gain=True),
    Column("success_rate_50", "SR 0.50", gain=False),
    Column("success_rate_75", "SR 0.75", gain=False),
    Column("precision_auc", "Precision AUC", gain=False),
)
"""Scores in the order of the table; those that a protocol does not define are left out."""

Marks: TypeAlias = tuple[str, str, str]
"""How a score is written that is neither best nor second, best, second: texts with a `{}`."""

_PLAIN = "none"


@dataclass(frozen=True, slots=True)
class Cell:
    """One score and its gain over the tracker alone, with its rank among the tracker's runs."""

    value: float
    gain: float = math.nan
    rank: int = 0

    @property
    def score(self) -> str:
        """Three decimals, or a dash where there is no score."""
        return "-" if math.isnan(self.value) else f"{self.value:.3f}"

    @property
    def gain_text(self) -> str:
        """Signed percent with three decimals, empty where there is nothing to compare with."""
        return "" if math.isnan(self.gain) else f"{self.gain:+.3f}"


@dataclass(frozen=True, slots=True)
class Row:
    """One run: its words, and a cell for each column of scores."""

    words: tuple[str, ...]
    cells: tuple[Cell, ...]


@dataclass(frozen=True, slots=True)
class ScoreTable:
    """A table ready to be written in any format.

    Attributes:
        dataset: its name.
        protocol: what the scores mean.
        counts: number of sequences and frames, in words.
        word_headings: headings of the columns of words.
        columns: the scores.
        groups: rows of one tracker each.
    """

    dataset: str
    protocol: str
    counts: str
    word_headings: tuple[str, ...]
    columns: tuple[Column, ...]
    groups: tuple[tuple[Row, ...], ...]

    @property
    def caption(self) -> str:
        """Dataset, what it holds, and protocol, in one line."""
        return f"{self.dataset}: {self.counts}; protocol {self.protocol}"

    @property
    def rows(self) -> Iterator[Row]:
        """All rows in order."""
        return (row for group in self.groups for row in group)

    @property
    def headings(self) -> tuple[str, ...]:
        """Headings of all columns, gains as "gain %"."""
        scores = (
            text
            for column in self.columns
            for text in (column.heading, "gain %")[: 1 + column.gain]
        )
        return (*self.word_headings, *scores)

    def texts(self, row: Row, marks: Marks = ("{}", "{}", "{}")) -> tuple[str, ...]:
        """A row as texts under `headings`; scores in the mark of their rank: none, best, second."""
        scores = (
            text
            for column, cell in zip(self.columns, row.cells, strict=True)
            for text in (marks[cell.rank].format(cell.score), cell.gain_text)[: 1 + column.gain]
        )
        return (*row.words, *scores)


def overall_table(summary: "pd.DataFrame") -> ScoreTable:
    """Trackers and their enhancers with scores and gains.

    Args:
        summary: rows of `Evaluation.summary()` of one dataset and protocol.

    Raises:
        ValueError: it is empty, or mixes datasets or protocols.
    """
    if summary.empty:
        msg = "no scores to make a table of"
        raise ValueError(msg)
    for column in ("dataset", "protocol"):
        if len(set(summary[column])) > 1:
            msg = f"one table cannot mix several values of {column}"
            raise ValueError(msg)
    columns = tuple(c for c in COLUMNS if c.name in summary and summary[c.name].notna().any())
    groups = []
    for _, runs in summary.groupby("tracker", sort=True):
        plain = runs[runs.enhancer == _PLAIN]
        enhanced = runs[runs.enhancer != _PLAIN].sort_values(["scope", "enhancer"])
        for position, (_, scoped) in enumerate(enhanced.groupby("scope", sort=True)):
            shown = [plain, scoped] if position == 0 else [scoped]
            groups.append(_rows(_concat(shown), plain, columns))
        if enhanced.empty:
            groups.append(_rows(plain, plain, columns))
    return ScoreTable(
        str(summary.dataset.iloc[0]),
        str(summary.protocol.iloc[0]),
        _counts(summary),
        ("Tracker", "Enhancer", "Scope"),
        columns,
        tuple(groups),
    )


def _concat(frames: "list[pd.DataFrame]") -> "pd.DataFrame":
    import pandas as pd

    return pd.concat([frame for frame in frames if not frame.empty])


def _counts(summary: "pd.DataFrame") -> str:
    counts = sorted(set(zip(summary.sequences, summary.frames, strict=True)))
    return " / ".join(f"{sequences} sequences, {frames} frames" for sequences, frames in counts)


def _rows(
    runs: "pd.DataFrame", plain: "pd.DataFrame", columns: tuple[Column, ...]
) -> tuple[Row, ...]:
    ranks = {column.name: _ranks([float(v) for v in runs[column.name]]) for column in columns}
    rows = []
    for position, (_, run) in enumerate(runs.iterrows()):
        enhanced = run.enhancer != _PLAIN
        # A gain over fewer or more sequences would compare different videos.
        base = plain[plain.sequences == run.sequences] if enhanced else plain.iloc[:0]
        cells = []
        for column in columns:
            value = float(run[column.name])
            gain = relative_gain(value, float(base[column.name].iloc[0])) if len(base) else math.nan
            cells.append(Cell(value, gain, ranks[column.name][position]))
        words = (run.tracker, run.enhancer if enhanced else "-", run.scope if enhanced else "")
        rows.append(Row(words, tuple(cells)))
    return tuple(rows)


def _ranks(values: list[float]) -> list[int]:
    """1 for the best, 2 for the second, by what three decimals show; 0 for all others."""
    shown = [round(value, 3) for value in values]
    order = sorted({value for value in shown if not math.isnan(value)}, reverse=True)
    if len(shown) < 2 or not order:
        return [0] * len(values)
    return [0 if math.isnan(value) else {0: 1, 1: 2}.get(order.index(value), 0) for value in shown]
