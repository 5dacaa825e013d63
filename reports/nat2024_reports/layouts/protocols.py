"""The same results under every protocol, beside the default one."""

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, TypeAlias

from nat2024_reports.layouts.scores import PLAIN, SCORES, caption, check_one, in_order
from nat2024_reports.tables import Cell, Column, Row, Table, score, words

if TYPE_CHECKING:
    import pandas as pd

_INSTEAD = "average_overlap"


def protocols_table(
    summaries: "pd.DataFrame", *, metric: str = "success_auc", base: str = "pysot"
) -> Table:
    """One row a run, one column a protocol with its difference to `base`.

    Args:
        summaries: rows of `Evaluation.summary()` of one dataset under several protocols.
        metric: the score that is shown.
        base: protocol that the others are compared with.

    Raises:
        ValueError: it is empty, mixes datasets, or has no row under `base`.
    """
    check_one(summaries, "dataset")
    every = dict.fromkeys(summaries.protocol.astype(str))
    if base not in every:
        msg = f"no scores under the protocol {base} to compare with"
        raise ValueError(msg)
    values = _values(summaries, metric)
    others = [one for one in every if one != base]
    # where no run has success, that is the average overlap, the area below its curve
    instead = [one for one in others if metric == "success_auc" and _empty(values, one)]
    values |= {key: v for key, v in _values(summaries, _INSTEAD).items() if key[1] in instead}
    first = summaries[summaries.protocol == base]
    body = [tuple(_row(run, base, others, values) for run in group) for group in in_order(first)]
    columns = [Column(heading, is_words=True) for heading in ("Tracker", "Enhancer")]
    columns.append(Column(base, part=base))
    for protocol in others:
        columns.append(Column(protocol, part=protocol))
        columns.append(Column("diff.", f"{protocol} difference", part=protocol))
    shown = next(one.heading for one in SCORES if one.name == metric)
    undefined = [one for one in (base, *others) if _empty(values, one)]
    notes = [f"diff.: less {base}"]
    notes += [f"{one}: average overlap, not success" for one in instead if one not in undefined]
    notes += [f"not defined under {', '.join(undefined)}"] if undefined else []
    return Table(
        f"{shown} on {caption(first, protocol='by column')}",
        tuple(columns),
        tuple(body),
        tuple(notes),
        {"Dataset": str(summaries.dataset.iloc[0]), "Score": metric},
    )


_Values: TypeAlias = dict[tuple[str, str], float]
"""Scores by run and protocol."""


def _values(summaries: "pd.DataFrame", metric: str) -> _Values:
    rows = summaries.to_dict(orient="records")
    return {(row["run"], row["protocol"]): float(row.get(metric, math.nan)) for row in rows}


def _empty(values: _Values, protocol: str) -> bool:
    return all(math.isnan(value) for (_, of), value in values.items() if of == protocol)


def _row(run: Mapping[Any, Any], base: str, others: list[str], values: _Values) -> Row:
    enhancer = "-" if run["enhancer"] == PLAIN else run["enhancer"]
    own = values[run["run"], base]
    cells = [words(run["tracker"]), words(enhancer), score(own)]
    for protocol in others:
        other = values.get((run["run"], protocol), math.nan)
        cells += [score(other), _difference(other - own)]
    return tuple(cells)


def _difference(value: float) -> Cell:
    if math.isnan(value):
        return Cell("", value)
    return Cell(f"{value:+.3f}" if abs(value) >= 0.0005 else "0", value)
