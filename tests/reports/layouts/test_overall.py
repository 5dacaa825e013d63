"""The table of all runs: rows, gains, ranks, and what is said about doubts."""

import math
from typing import Any

import pandas as pd
import pytest

from nat2024.metrics import FEWEST_SEQUENCES
from nat2024_reports import overall_table
from nat2024_reports.layouts.scores import FEWEST
from nat2024_reports.tables import Row, Table


def texts(row: Row) -> list[str]:
    return [cell.text for cell in row]


def column(table: Table, heading: str) -> list[Any]:
    number = table.headings.index(heading)
    return [row[number] for row in table.rows]


def test_rows_gains_and_ranks(paper: pd.DataFrame) -> None:
    kept = paper[paper.enhancer.isin(["none", "sct", "ldenhancer", "lime"])]
    table = overall_table(kept).for_page()
    assert table.caption == (
        "uavdark_135: 135 sequences, 125466 frames; protocol pysot; scope patch"
    )
    assert table.headings == ("Tracker", "Enhancer", "Success", "gain %", "Precision", "gain %")
    (group,) = table.groups
    assert [texts(row)[:4] for row in group] == [
        ["siamrpnpp", "-", "0.372", ""],
        ["siamrpnpp", "ldenhancer", "0.434", "+16.667"],
        ["siamrpnpp", "lime", "0.393", "+5.645"],
        ["siamrpnpp", "sct", "0.421", "+13.172"],
    ]
    assert [cell.rank for cell in column(table, "Success")] == [0, 1, 0, 2]
    assert not table.footnotes


def test_scopes_are_never_compared_with_each_other(summary: Any) -> None:
    rows = [
        ("a", "a", "none", "patch", 0.5, 0.5),
        ("a+g", "a", "g", "patch", 0.6, 0.6),
        ("a+h", "a", "h", "frame", 0.7, 0.7),
        ("a+i", "a", "i", "", 0.8, 0.7),
    ]
    table = overall_table(summary(rows)).for_page()
    words = [[texts(row)[1:3] for row in group] for group in table.groups]
    assert words == [[["-", ""], ["i", "unknown"]], [["h", "frame"]], [["g", "patch"]]]
    assert [group[-1][3].rank for group in table.groups] == [1, 0, 0]


def test_gains_have_columns_only_where_there_are_any_but_always_in_files(summary: Any) -> None:
    plain = [("a", "a", "none", "", 0.5, 0.5), ("b", "b", "none", "", 0.6, 0.6)]
    enhanced = [*plain, ("a+g", "a", "g", "patch", 0.6, 0.6)]
    for intervals in (False, True):
        without, with_gains = (
            overall_table(summary(rows), intervals=intervals) for rows in (plain, enhanced)
        )
        assert without.for_page().headings == ("Tracker", "Enhancer", "Success", "Precision")
        assert "gain %" in with_gains.for_page().headings
        assert without.for_file().headings == with_gains.for_file().headings
        assert {len(row) for row in without.rows} == {len(without.columns)}


def test_without_the_plain_tracker_there_is_no_gain(summary: Any) -> None:
    table = overall_table(summary([("a+g", "a", "g", "patch", 0.6, 0.6)]))
    (cell,) = column(table.for_page(), "Success")
    assert cell.rank == 0
    assert texts(next(table.for_page().rows)) == ["a", "g", "0.600", "0.600"]
    assert table.footnotes == ("no gains of a: not run without an enhancer",)


def test_equal_to_three_decimals_is_equally_good(summary: Any) -> None:
    rows = [
        ("a", "a", "none", "patch", 0.50001, 0.1),
        ("a+g", "a", "g", "patch", 0.50004, 0.2),
        ("a+h", "a", "h", "patch", 0.4, math.nan),
    ]
    table = overall_table(summary(rows))
    assert [cell.rank for cell in column(table, "Success")] == [1, 1, 2]
    precision = column(table, "Precision")
    assert [cell.rank for cell in precision] == [2, 1, 0]
    assert precision[2].text == "-"


def test_datasets_and_protocols_are_not_mixed(paper: pd.DataFrame) -> None:
    mixed = paper.assign(protocol=["otb"] + ["pysot"] * (len(paper) - 1))
    with pytest.raises(ValueError, match="several values of protocol"):
        overall_table(mixed)
    with pytest.raises(ValueError, match="no scores"):
        overall_table(paper.iloc[:0])


def test_no_gain_over_another_set_of_sequences(summary: Any) -> None:
    rows = [("a", "a", "none", "patch", 0.5, 0.5), ("a+g", "a", "g", "patch", 0.6, 0.6)]
    table = overall_table(summary(rows, sequences=[3, 2], frames=[30, 20]))
    assert "gain %" not in table.for_page().headings
    assert table.caption.startswith("uavdark_135: 2 to 3 sequences, up to 30 frames;")


ROWS = [
    ("a", "a", "none", "patch", 0.5, 0.5),
    ("a+g", "a", "g", "patch", 0.6, 0.6),
    ("a+h", "a", "h", "patch", 0.55, 0.6),
]


def test_doubtful_gains_are_marked_and_explained(summary: Any, gains: Any) -> None:
    found = gains([("a+g", 20.0, 10.0, 30.0, True), ("a+h", 10.0, -1.0, 21.0, False)])
    table = overall_table(summary(ROWS), found)
    marks = [cell.is_doubtful for cell in column(table.for_page(), "gain %")]
    assert marks == [False, False, True]
    assert table.footnotes == (
        "~ may be noise: the interval of the gain over 135 sequences includes 0 (95 %, paired "
        "bootstrap)",
    )


def test_few_sequences_are_said_to_be_noise(summary: Any, gains: Any) -> None:
    found = gains([("a+g", 20.0, 10.0, 30.0, False)], sequences=4)
    table = overall_table(summary(ROWS[:2], sequences=4), found)
    assert table.footnotes == ("~ noise: 4 sequences are too few to tell a gain from chance",)
    one = gains([("a+g", 20.0, math.nan, math.nan, False)], sequences=1)
    assert overall_table(summary(ROWS[:2], sequences=1), one).footnotes == (
        "~ noise: 1 sequence is too few to tell a gain from chance",
    )
    assert FEWEST == FEWEST_SEQUENCES


def test_gains_over_fewer_sequences_say_so(summary: Any, gains: Any) -> None:
    found = gains([("a+g", 20.0, 10.0, 30.0, True)], sequences=130)
    table = overall_table(summary(ROWS[:2]), found)
    assert table.footnotes == (
        "gains of a+g: over the 130 sequences that it and the tracker alone have",
    )


def test_a_tracker_alone_over_more_sequences_is_told(summary: Any, gains: Any) -> None:
    found = gains([("a+g", 20.0, 10.0, 30.0, True)], sequences=130)
    table = overall_table(summary(ROWS[:2], sequences=[135, 130]), found)
    assert table.footnotes == (
        "gains of a+g: over the 130 sequences that it and the tracker alone have",
    )


def test_intervals(summary: Any, gains: Any) -> None:
    found = gains([("a+g", 20.0, 10.04, 30.06, True)])
    page = overall_table(summary(ROWS[:2]), found, intervals=True).for_page()
    assert page.headings[2:6] == ("Success", "gain %", "95% interval", "better %")
    assert texts(list(page.rows)[1])[2:6] == ["0.600", "+20.000", "[+10.0, +30.1]", "60"]
    assert texts(next(page.rows))[3:6] == ["", "", ""]
    # programs get them anyhow, and in full
    file = overall_table(summary(ROWS[:2]), found).for_file()
    names = [one.name or one.heading for one in file.columns]
    cells = dict(zip(names, list(file.rows)[1], strict=True))
    assert cells["Success gain low %"].value == 10.04
    assert cells["Success improved %"].value == 60


def test_capitals_change_no_order(summary: Any) -> None:
    rows = [(name, name, "none", "patch", 0.5, 0.5) for name in ("KCF", "fDSST", "MOSSE")]
    found = [cell.text for cell in column(overall_table(summary(rows)), "Tracker")]
    assert found == ["fDSST", "KCF", "MOSSE"]
