"""A paper's numbers beside what result files give, and the difference of every cell."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from nat2024_reports.tables import MISSING, Cell, Column, Table, number, score, words

_METRICS = {"success": "success", "precision": "precision"}


def reproduced_tables(rows: Sequence[Mapping[str, Any]], facts: Mapping[str, str]) -> list[Table]:
    """Two tables, success and precision, for each table of the paper.

    Args:
        rows: `table, method, sequences, equal, note`, and the mappings `paper`, `files` and
            `difference` of `success, precision, success_gain, precision_gain`; None where there
            is no number.
        facts: what holds for all rows: `paper`, `dataset`, `protocol`.
    """
    names = dict.fromkeys(row["table"] for row in rows)
    return [
        _table(name, metric, [row for row in rows if row["table"] == name], facts)
        for name in names
        for metric in _METRICS
    ]


def _table(
    name: str, metric: str, rows: Sequence[Mapping[str, Any]], facts: Mapping[str, str]
) -> Table:
    gain = f"{metric}_gain"
    body = tuple(
        (
            words(row["method"]),
            *(score(_value(row[side][metric])) for side in ("paper", "files")),
            _signed(row["difference"][metric]),
            *(number(_value(row[side][gain]), ".3f") for side in ("paper", "files")),
            _signed(row["difference"][gain]),
            Cell(str(row["sequences"]) if row["sequences"] else MISSING, row["sequences"]),
        )
        for row in rows
    )
    columns = (
        Column("Method", is_words=True),
        Column("Paper", f"paper_{metric}"),
        Column("Files", f"files_{metric}"),
        Column("Difference", f"{metric}_difference"),
        Column("Gain % paper", f"paper_{gain}"),
        Column("Gain % files", f"files_{gain}"),
        Column("Gain % difference", f"{gain}_difference"),
        Column("Sequences", "sequences"),
    )
    caption = f"{name}, {metric}; {facts['dataset']}; protocol {facts['protocol']}"
    return Table(caption, columns, (body,), _footnotes(rows), dict(facts))


def _value(value: float | None) -> float:
    return math.nan if value is None else value


def _signed(difference: float | None) -> Cell:
    """A difference with its sign, and plain where there is none."""
    if difference is None:
        return Cell(MISSING)
    return Cell(f"{difference:+.3f}" if difference else "0.000", difference)


def _footnotes(rows: Sequence[Mapping[str, Any]]) -> tuple[str, ...]:
    by_note: dict[str, list[str]] = {}
    for row in rows:
        if row["note"]:
            by_note.setdefault(row["note"], []).append(row["method"])
    compared = [row for row in rows if row["equal"] is not None]
    equal = sum(bool(row["equal"]) for row in compared)
    summary = f"{equal} of {len(compared)} rows with files are equal in every digit printed"
    return (summary, *(f"{', '.join(names)}: {note}" for note, names in by_note.items()))
