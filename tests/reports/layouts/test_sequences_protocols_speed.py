"""Sequences against runs, protocols side by side, and speed."""

import math
from typing import Any

import pandas as pd
import pytest

from nat2024_reports.layouts import protocols_table, sequences_table, speed_table
from nat2024_reports.tables import Table

RUNS = [("a", "a", "none", "patch", 0.5, 0.6), ("a+g", "a", "g", "patch", 0.6, 0.5)]


def texts(table: Table) -> list[list[str]]:
    return [[cell.text for cell in row] for row in table.for_page().rows]


def test_sequences(summary: Any) -> None:
    rows = [("a", "s10", 20, 0.4), ("a", "s9", 10, 0.6), ("a+g", "s9", 10, 0.7)]
    scores = pd.DataFrame(rows, columns=["run", "sequence", "frames", "success_auc"])
    table = sequences_table(summary(RUNS, sequences=[2, 1], frames=[30, 10]), scores)
    assert table.headings == ("Sequence", "Frames", "a", "a +g")
    assert texts(table) == [
        ["s9", "10", "0.600", "0.700"],
        ["s10", "20", "0.400", "-"],
        ["mean", "30", "0.500", "0.600"],
    ]
    assert [[cell.rank for cell in row[2:]] for row in table.rows] == [[2, 1], [1, 0], [2, 1]]
    assert table.footnotes == ("- no result; the mean of a +g is over fewer sequences",)


def test_sequences_below_the_names_of_methods(summary: Any) -> None:
    rows = [
        ("a@x", "A@x", "none", "", 0.5, 0.6),
        ("a@x+g", "A@x", "G (v)", "patch", 0.5, 0.6),
        ("a@x+h(frame)", "A@x", "H", "frame", 0.5, 0.6),
        ("a@x+h", "A@x", "H", "patch", 0.5, 0.6),
        ("b_1", "B", "none", "", 0.5, 0.6),
        ("b_2", "B", "none", "", 0.5, 0.6),
    ]
    scores = pd.DataFrame(
        [(run, "s", 20, 0.4) for run, *_ in rows],
        columns=["run", "sequence", "frames", "success_auc"],
    )
    columns = sequences_table(summary(rows), scores).columns[2:]
    assert {column.name: column.heading for column in columns} == {
        "a@x": "A@x",
        "a@x+g": "A@x +G (v)",
        "a@x+h(frame)": "A@x +H (frame)",
        "a@x+h": "A@x +H (patch)",
        "b_1": "b_1",
        "b_2": "b_2",
    }


def test_protocols(summary: Any) -> None:
    strict = summary(RUNS, protocol="strict", average_overlap=math.nan)
    strict.success_auc = [0.52, 0.6002]
    pooled = summary(RUNS, protocol="got10k-ao", success_auc=math.nan)
    pooled["average_overlap"] = [0.45, 0.7]
    table = protocols_table(pd.concat([summary(RUNS), strict, pooled], ignore_index=True))
    assert table.headings == (
        "Tracker",
        "Enhancer",
        "pysot",
        "strict",
        "diff.",
        "got10k-ao",
        "diff.",
    )
    assert texts(table) == [
        ["a", "-", "0.500", "0.520", "+0.020", "0.450", "-0.050"],
        ["a", "g", "0.600", "0.600", "0", "0.700", "+0.100"],
    ]
    assert table.footnotes == ("diff.: less pysot", "got10k-ao: average overlap, not success")
    precision = protocols_table(
        pd.concat([summary(RUNS), pooled.assign(precision_20=math.nan)]), metric="precision_20"
    )
    assert texts(precision)[0] == ["a", "-", "0.600", "-", ""]
    assert precision.footnotes[-1] == "not defined under got10k-ao"
    with pytest.raises(ValueError, match="no scores under the protocol pysot"):
        protocols_table(strict)


TIMES = {
    "run": "a",
    "device": "cpu",
    "threads": 1,
    "workers": 1,
    "machine": "x",
    "read_ms": 1.0,
    "enhance_ms": 0.0,
    "track_ms": 20.0,
    "frames_per_second": 50.0,
    "end_to_end_frames_per_second": 47.6,
}


def test_speed(summary: Any) -> None:
    table = speed_table(summary(RUNS), pd.DataFrame([TIMES]))
    assert texts(table) == [
        ["a", "-", "0.500", "50.0", "47.6", "1.00", "0.00", "20.00", "cpu", "1"],
        ["a", "g", "0.600", "-", "-", "-", "-", "-", "", "-"],
    ]
    assert table.footnotes[1:] == ("no times stored of a+g",)


def test_speeds_of_different_machines_are_not_compared(summary: Any) -> None:
    other = {**TIMES, "run": "a+g", "device": "cuda", "threads": 2}
    table = speed_table(summary(RUNS), pd.DataFrame([TIMES, other]))
    assert table.footnotes[1:] == (
        "measured on different devices and numbers of threads: do not compare",
    )
