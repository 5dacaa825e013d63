"""How fast runs were, beside how well they track."""

import math
from typing import TYPE_CHECKING

from nat2024_reports.layouts.scores import (
    PLAIN,
    caption,
    check_one,
    defined_scores,
    facts,
    in_order,
    names_of,
)
from nat2024_reports.tables import Cell, Column, Table, number, ranks, score, words

if TYPE_CHECKING:
    import pandas as pd

_NUMBERS = {
    "frames_per_second": ("Frames /s", ".1f"),
    "end_to_end_frames_per_second": ("with reading", ".1f"),
    "read_ms": ("Read ms", ".2f"),
    "enhance_ms": ("Enhance ms", ".2f"),
    "track_ms": ("Track ms", ".2f"),
}


def speed_table(summary: "pd.DataFrame", timing: "pd.DataFrame") -> Table:
    """Success, frames per second, and the milliseconds of each stage.

    Args:
        summary: rows of `Evaluation.summary()` of one dataset and protocol.
        timing: rows of `Evaluation.timing()`.

    Raises:
        ValueError: it is empty, or mixes datasets or protocols.
    """
    check_one(summary, "dataset", "protocol")
    shown = defined_scores(summary)[:1]
    times = {row["run"]: row for row in timing.to_dict(orient="records")}
    body = []
    for group in in_order(summary):
        places = {one.name: ranks([float(run[one.name]) for run in group]) for one in shown}
        lines = []
        for position, run in enumerate(group):
            enhancer = "-" if run["enhancer"] == PLAIN else run["enhancer"]
            cells = [words(run["tracker"]), words(enhancer)]
            cells += [score(float(run[one.name]), places[one.name][position]) for one in shown]
            time = times.get(run["run"], {})
            cells += [
                number(float(time.get(name, math.nan)), form)
                for name, (_, form) in _NUMBERS.items()
            ]
            cells += [
                Cell(str(time.get("device", ""))),
                number(time.get("threads", math.nan), ".0f"),
            ]
            lines.append(tuple(cells))
        body.append(tuple(lines))
    columns = [Column(heading, is_words=True) for heading in ("Tracker", "Enhancer")]
    columns += [Column(one.heading) for one in shown]
    columns += [Column(heading, name) for name, (heading, _) in _NUMBERS.items()]
    columns += [Column("Device"), Column("Threads")]
    untimed = [str(run) for run in summary.run if run not in times]
    notes = ["frames/s: enhancing and tracking, without the first frame of a sequence"]
    notes += [f"no times stored of {names_of(untimed)}"] if untimed else []
    notes += _incomparable(timing)
    return Table(
        f"Speed on {caption(summary)}", tuple(columns), tuple(body), tuple(notes), facts(summary)
    )


def _incomparable(timing: "pd.DataFrame") -> list[str]:
    """Why speeds of these runs cannot be compared, if so."""
    different = [
        words
        for column, words in (
            ("device", "devices"),
            ("threads", "numbers of threads"),
            ("machine", "machines"),
            ("workers", "numbers of workers at once"),
        )
        if column in timing and len(set(timing[column])) > 1
    ]
    return [f"measured on different {' and '.join(different)}: do not compare"] if different else []
