"""Layouts of tables: which scores each needs, and printing them."""

import logging
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import click

from nat2024.cli.failing import failures_of, losses_of
from nat2024.cli.output import print_table, table_width
from nat2024.cli.scoring import Scored
from nat2024.errors import NatBenchError, UsageError

if TYPE_CHECKING:
    import pandas as pd

    from nat2024.evaluation import Evaluation
    from nat2024_reports.tables import Cell, Table

log = logging.getLogger("nat2024")

SCORE_NAMES = {
    "success": "success_auc",
    "precision": "precision_20",
    "normalized_precision": "normalized_precision_20",
    "average_overlap": "average_overlap",
}
"""Scores that tables of one number show, by the name of the option."""

_STYLES = ("", "bold", "underline")


@dataclass(frozen=True, slots=True)
class Wish:
    """What a table shows.

    Attributes:
        score: the one that tables of one number show.
        intervals: show intervals of gains.
        titles: call trackers and enhancers as papers do, else as options of the command line do.
    """

    score: str = "success"
    intervals: bool = False
    titles: bool = False

    def named(self, table: "pd.DataFrame") -> "pd.DataFrame":
        """A table with its columns `tracker` and `enhancer` in the wished names."""
        if not self.titles:
            return table
        names = _names(table)
        shown = {one: table[one].astype(str).map(names) for one in ("tracker", "enhancer")}
        return table.assign(**shown)


def print_scores(evaluations: "Iterable[Evaluation]") -> None:
    """Print the table of each evaluation: scores, and gains over the tracker alone."""
    for evaluation in evaluations:
        print_tables(_overall(evaluation, Wish()))


def print_tables(tables: "Iterable[Table]") -> None:
    """Print tables, each in as many parts as 100 columns need."""
    from nat2024_reports.formats import fitting_parts
    from nat2024_reports.tables import heading_lines

    for table in tables:
        for part in fitting_parts(table, table_width()):
            rows = list(part.rows)
            ends, last = set(), 0
            for group in part.groups:
                last += len(group)
                ends.add(last - 1)
            print_table(
                ["\n".join(heading_lines(heading)) for heading in part.headings],
                [[_text(cell) for cell in row] for row in rows],
                title=part.caption,
                words=part.words,
                styles=[[_style(cell) for cell in row] for row in rows],
                rules=ends,
            )
        for note in table.footnotes:
            click.echo(note)
        if table.footnotes:
            click.echo()


def _text(cell: "Cell") -> str:
    from nat2024_reports.tables import MARK

    # before the number, so that digits stay below each other
    return f"{MARK}{cell.text}" if cell.is_doubtful else cell.text


def _style(cell: "Cell") -> str:
    return f"{_STYLES[cell.rank]} {'dim' if cell.is_doubtful else ''}".strip()


def make_tables(scored: Iterable[Scored], layout: str, wish: Wish) -> "list[Table]":
    """Tables of one layout, of every dataset that has what it needs.

    Raises:
        UsageError: none has.
    """
    tables: list[Table] = []
    problems: list[str] = []
    for one in scored:
        try:
            tables += LAYOUTS[layout](one, wish)
        except NatBenchError as error:
            problems.append(str(error))
    if not tables:
        msg = "; ".join(problems)
        raise UsageError(msg)
    for problem in problems:
        log.warning("no table: %s", problem)
    return tables


def _overall(evaluation: "Evaluation", wish: Wish) -> "list[Table]":
    from nat2024_reports.layouts import overall_table

    summary, gains = evaluation.summary(), evaluation.gains()
    return [overall_table(wish.named(summary), gains, intervals=wish.intervals)]


def _enhancers(scored: Scored, wish: Wish) -> "list[Table]":
    from nat2024_reports.layouts import enhancers_tables

    evaluation = scored.evaluation
    summary, gains = evaluation.summary(), evaluation.gains()
    if (summary.enhancer == "none").all():
        msg = f"{evaluation.dataset}: no run with an enhancer; `nat-bench run --enhancer NAME`"
        raise UsageError(msg)
    names = _names(summary)
    return enhancers_tables(summary, gains, names=names, intervals=wish.intervals)


def _names(summary: "pd.DataFrame") -> dict[str, str]:
    from nat2024.cli.display_names import display_names

    trackers = display_names(dict.fromkeys(map(str, summary.tracker)), "tracker")
    return trackers | display_names(dict.fromkeys(map(str, summary.enhancer)), "enhancer")


def _ablation(scored: Scored, wish: Wish) -> "list[Table]":
    from nat2024.cli.ablations import ablations_of
    from nat2024_reports.layouts import ablation_table, comparable

    evaluation = scored.evaluation
    summary, gains = evaluation.summary(), evaluation.gains()
    names = _names(summary)
    tables = [
        ablation_table(runs, ablation, gains, names=names, intervals=wish.intervals)
        for ablation in ablations_of(evaluation)
        for runs in comparable(summary)
        if ablation.is_told_by(runs.run)
    ]
    if not tables:
        msg = (
            f"{evaluation.dataset}: no run of a variant; label them ldenhancer@baseline, "
            "ldenhancer@TB, ldenhancer@TB_LS, with -1, -2, ... behind for seeds"
        )
        raise UsageError(msg)
    return tables


def _groups(by: Literal["attribute", "category"]) -> "Callable[[Scored, Wish], list[Table]]":
    def make(scored: Scored, wish: Wish) -> "list[Table]":
        from nat2024_reports.layouts import groups_table

        evaluation = scored.evaluation
        scores = evaluation.per_attribute() if by == "attribute" else evaluation.per_category()
        gains = evaluation.gains(by=by)
        if wish.titles and by == "category":
            scores, gains = (one.assign(category=_words(one)) for one in (scores, gains))
        if scores.empty:
            what, cure = (
                ("has an attribute", "; --computed-attributes computes some")
                if by == "attribute"
                else ("tells its category", "")
            )
            msg = f"{evaluation.dataset}: no sequence {what}{cure}"
            raise UsageError(msg)
        return [
            groups_table(
                wish.named(evaluation.summary()),
                wish.named(scores),
                by,
                gains,
                metric=_metric(evaluation, wish),
                intervals=wish.intervals,
            )
        ]

    return make


def _words(table: "pd.DataFrame") -> "pd.Series[str]":
    from nat2024.cli.display_names import category_name

    return table["category"].astype(str).map(category_name)


def _metric(evaluation: "Evaluation", wish: Wish) -> str:
    name = SCORE_NAMES[wish.score]
    if evaluation.summary()[name].isna().all():
        if wish.score == "success" and evaluation.protocol.name == "got10k-ao":
            return "average_overlap"
        msg = f"{evaluation.dataset}: protocol {evaluation.protocol.title} has no {wish.score}"
        raise UsageError(msg)
    return name


def _sequences(scored: Scored, wish: Wish) -> "list[Table]":
    from nat2024_reports.layouts import sequences_table

    evaluation = scored.evaluation
    metric = _metric(evaluation, wish)
    summary = wish.named(evaluation.summary())
    return [sequences_table(summary, evaluation.per_sequence(), metric=metric)]


def _protocols(scored: Scored, wish: Wish) -> "list[Table]":
    import pandas as pd

    from nat2024.evaluation import evaluate
    from nat2024.metrics import list_protocols
    from nat2024_reports.layouts import protocols_table

    found = []
    for protocol in list_protocols():
        try:
            evaluation = evaluate(
                scored.folder, scored.dataset, protocol=protocol, cache=scored.cache
            )
        except NatBenchError as error:  # one protocol may refuse what others take
            log.warning("%s: left out, %s", protocol, error)
            continue
        found.append(evaluation.summary())
    bases = [frame.protocol.iloc[0] for frame in found]
    if not bases:
        msg = f"{scored.dataset.name}: no protocol scores these results"
        raise UsageError(msg)
    metric = SCORE_NAMES[wish.score]
    every = wish.named(pd.concat(found, ignore_index=True))
    return [protocols_table(every, metric=metric, base=bases[0])]


def _speed(scored: Scored, wish: Wish) -> "list[Table]":
    from nat2024_reports.layouts import speed_table

    evaluation = scored.evaluation
    timing = evaluation.timing()
    if timing.empty:
        msg = f"{evaluation.dataset}: no manifest tells how long a run took"
        raise UsageError(msg)
    return [speed_table(wish.named(evaluation.summary()), timing)]


LAYOUTS: "dict[str, Callable[[Scored, Wish], list[Table]]]" = {
    "overall": lambda scored, wish: _overall(scored.evaluation, wish),
    "enhancers": _enhancers,
    "ablation": _ablation,
    "attributes": _groups("attribute"),
    "categories": _groups("category"),
    "sequences": _sequences,
    "protocols": _protocols,
    "speed": _speed,
    "failures": lambda scored, wish: failures_of(scored, wish.named),
    "losses": lambda scored, wish: losses_of(scored, wish.named),
}
"""Layouts by name, each from one dataset's scores to its tables."""
