"""What the layouts share: scores, gains with their doubts, captions."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from nat2024_reports.gains import relative_gain
from nat2024_reports.tables import MARK, Cell, Column

if TYPE_CHECKING:
    import pandas as pd

PLAIN = "none"
"""The enhancer of a tracker alone."""

FEWEST = 6
"""Sequences below which nothing is certain; `nat2024.metrics.FEWEST_SEQUENCES`."""

_SHOWN_NAMES = 5


@dataclass(frozen=True, slots=True)
class Score:
    """One score: its name in a summary, its headings, and whether its gain is shown beside it."""

    name: str
    heading: str
    gain: bool = False


SCORES = (
    Score("success_auc", "Success", gain=True),
    Score("precision_20", "Precision", gain=True),
    Score("normalized_precision_20", "Norm. prec.", gain=True),
    Score("normalized_precision_auc", "Norm. prec. AUC"),
    Score("average_overlap", "Average overlap", gain=True),
    Score("success_rate_50", "SR 0.50"),
    Score("success_rate_75", "SR 0.75"),
    Score("precision_auc", "Precision AUC"),
)
"""Scores in the order of tables; those that a protocol does not define are left out."""


@dataclass(frozen=True, slots=True)
class Gain:
    """What a run gains over its tracker alone in one score.

    Attributes:
        percent: relative gain.
        low: lower end of its 95 % interval, NaN where not known.
        high: upper end.
        improved: share of the sequences that get better, NaN where not known.
        sequences: how many both have.
        certain: whether the interval excludes 0; None where there is none.
    """

    percent: float = math.nan
    low: float = math.nan
    high: float = math.nan
    improved: float = math.nan
    sequences: int = 0
    certain: bool | None = None

    @property
    def is_doubtful(self) -> bool:
        """Whether it may well be chance."""
        return self.certain is False


NO_GAIN = Gain()


def gains_by_run(
    summary: "pd.DataFrame", gains: "pd.DataFrame | None" = None
) -> dict[tuple[str, str], Gain]:
    """Gains by run and score.

    Args:
        summary: rows of `Evaluation.summary()`.
        gains: rows of `Evaluation.gains()`; without it gains are those of the scores, and nothing
            tells how sure they are.
    """
    if gains is not None:
        return {
            (row["run"], row["metric"]): gain_of(row) for row in gains.to_dict(orient="records")
        }
    found = {}
    for _, runs in summary.groupby("tracker"):
        plain = runs[runs.enhancer == PLAIN]
        for row in runs[runs.enhancer != PLAIN].to_dict(orient="records"):
            # A gain over fewer or more sequences would compare different videos.
            base = plain[plain.sequences == row["sequences"]]
            for score in SCORES:
                if len(base) and score.name in base:
                    percent = relative_gain(float(row[score.name]), float(base[score.name].iloc[0]))
                    found[row["run"], score.name] = Gain(percent, sequences=row["sequences"])
    return found


def gain_of(row: Mapping[Any, Any]) -> Gain:
    """A row of `Evaluation.gains()`."""
    return Gain(
        float(row["gain"]),
        float(row["gain_low"]),
        float(row["gain_high"]),
        float(row["improved"]),
        int(row["sequences"]),
        bool(row["certain"]),
    )


def gain_cell(gain: Gain, rank: int = 0) -> Cell:
    """Signed percent with three decimals, empty where there is nothing to compare with."""
    text = "" if math.isnan(gain.percent) else f"{gain.percent:+.3f}"
    return Cell(text, gain.percent, rank, gain.is_doubtful and bool(text))


def gain_columns(name: str, *, intervals: bool, heading: str = "gain %") -> list[Column]:
    """The gain of a score, and what tells how sure it is; `gain_cells` fills them."""
    columns = [Column(heading, f"{name} gain %", part=name)]
    if intervals:
        columns.append(Column("95% interval", part=name, where="page"))
    return [
        *columns,
        Column("better %", f"{name} improved %", part=name, where="all" if intervals else "file"),
        Column("", f"{name} gain low %", where="file"),
        Column("", f"{name} gain high %", where="file"),
    ]


def for_programs(columns: Iterable[Column]) -> list[Column]:
    """The same columns, but only in files, whose columns do not depend on what runs there are."""
    return [replace(one, where="file") for one in columns]


def gain_cells(gain: Gain, *, intervals: bool, rank: int = 0) -> list[Cell]:
    """The cells of `gain_columns`."""
    known = not math.isnan(gain.low)
    interval = Cell(f"[{gain.low:+.1f}, {gain.high:+.1f}]" if known else "")
    better = 100 * gain.improved
    return [
        gain_cell(gain, rank),
        *([interval] if intervals else []),
        Cell("" if math.isnan(better) else f"{better:.0f}", better),
        Cell("", gain.low),
        Cell("", gain.high),
    ]


def doubts(gains: Iterable[Gain]) -> list[str]:
    """Footnotes that say what the mark of doubt means here."""
    doubtful = [gain for gain in gains if gain.is_doubtful and not math.isnan(gain.percent)]
    few = {gain.sequences for gain in doubtful if gain.sequences < FEWEST}
    many = {gain.sequences for gain in doubtful if gain.sequences >= FEWEST}
    notes = []
    if many:
        notes.append(
            f"{MARK} may be noise: the interval of the gain over {_range(many)} sequences "
            "includes 0 (95 %, paired bootstrap)"
        )
    if few:
        notes.append(
            f"{MARK} noise: {_range(few)} sequence{'s are' if few != {1} else ' is'} too few to "
            "tell a gain from chance"
        )
    return notes


def _range(numbers: set[int]) -> str:
    least, most = min(numbers), max(numbers)
    return str(least) if least == most else f"{least} to {most}"


def comparisons(summary: "pd.DataFrame", gains: Mapping[tuple[str, str], Gain]) -> list[str]:
    """Footnotes about runs that are compared with nothing, or on other sequences than shown."""
    enhanced = summary[summary.enhancer != PLAIN]
    shared: dict[str, set[int]] = {}
    for (run, _), gain in gains.items():
        shared.setdefault(run, set()).add(gain.sequences)
    alone = {row["tracker"]: None for row in _records(enhanced) if row["run"] not in shared}
    notes = [f"no gains of {names_of(alone)}: not run without an enhancer"] if alone else []
    fewer: dict[str, list[str]] = {}
    plain = summary[summary.enhancer == PLAIN]
    of_alone = dict(zip(plain.tracker, plain.sequences, strict=True))
    for row in _records(enhanced):
        shown = {row["sequences"]} & {of_alone.get(row["tracker"], row["sequences"])}
        counts = shared.get(row["run"], set()) - shown
        if counts:
            fewer.setdefault(_range(counts), []).append(row["run"])
    return notes + [
        f"gains of {names_of(runs)}: over the {count} sequences that it and the tracker alone have"
        for count, runs in fewer.items()
    ]


def _records(frame: "pd.DataFrame") -> list[dict[Any, Any]]:
    return frame.to_dict(orient="records")


def names_of(names: Iterable[str]) -> str:
    """The first few of them, for a footnote."""
    found = list(names)
    return ", ".join(found[:_SHOWN_NAMES]) + (", ..." if len(found) > _SHOWN_NAMES else "")


def check_one(summary: "pd.DataFrame", *columns: str) -> None:
    """Refuse a summary that is empty, or that mixes values of these columns.

    Raises:
        ValueError: one line that says which.
    """
    if summary.empty:
        msg = "no scores to make a table of"
        raise ValueError(msg)
    for column in columns:
        if len(set(summary[column])) > 1:
            msg = f"one table cannot mix several values of {column}"
            raise ValueError(msg)


def defined_scores(summary: "pd.DataFrame") -> list[Score]:
    """Those of `SCORES` that any run has."""
    return [one for one in SCORES if one.name in summary and summary[one.name].notna().any()]


def caption(summary: "pd.DataFrame", *, protocol: str | None = None) -> str:
    """Dataset, what it holds, and protocol, in one line."""
    counts = sorted(set(zip(summary.sequences, summary.frames, strict=True)))
    if len(counts) == 1:
        held = "{} sequences, {} frames".format(*counts[0])
    else:
        (least, _), (most, frames) = counts[0], counts[-1]
        held = f"{least} to {most} sequences, up to {frames} frames"
    title = protocol or str(summary.protocol.iloc[0])
    return f"{summary.dataset.iloc[0]}: {held}; protocol {title}"


def facts(summary: "pd.DataFrame") -> dict[str, str]:
    """Dataset and protocol, which files for programs repeat in every row."""
    return {
        "Dataset": str(summary.dataset.iloc[0]),
        "Protocol": str(summary.protocol.iloc[0]),
    }


UNKNOWN_SCOPE = "unknown"


def comparable(summary: "pd.DataFrame") -> "list[pd.DataFrame]":
    """The runs of each tracker and enhancement scope, with the tracker alone."""
    import pandas as pd

    found = []
    for _, runs in summary.groupby("tracker", sort=True):
        plain, enhanced = runs[runs.enhancer == PLAIN], runs[runs.enhancer != PLAIN]
        for _, scoped in enhanced.groupby("scope", sort=True):
            found.append(pd.concat([plain, scoped]) if len(plain) else scoped)
    return found


def scope_of(summary: "pd.DataFrame") -> str:
    """What was enhanced, as the end of a caption; empty where nothing or several things were."""
    scopes = set(summary.scope[summary.enhancer != PLAIN])
    scope = scopes.pop() if len(scopes) == 1 else ""
    return f"; scope {scope}" if scope else ""


def _folded(names: "pd.Series[str]") -> "pd.Series[str]":
    """Names by which fDSST comes before KCF, as `fdsst` does before `kcf`."""
    return names.map(str.casefold).rename("folded")


def in_order(summary: "pd.DataFrame") -> "list[list[dict[Any, Any]]]":
    """Rows in groups of one tracker: the tracker alone, then its enhancers by scope and name.

    Enhancement scopes are never mixed in one group.
    """
    groups = []
    for _, runs in summary.groupby([_folded(summary.tracker), "tracker"], sort=True):
        plain = _records(runs[runs.enhancer == PLAIN])
        enhanced = runs[runs.enhancer != PLAIN].sort_values(["scope", "enhancer"], key=_folded)
        scoped = [_records(rows) for _, rows in enhanced.groupby("scope", sort=True)]
        groups.append(plain + (scoped[0] if scoped else []))
        groups += scoped[1:]
    return groups
