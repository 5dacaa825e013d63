"""Runs against attributes and categories."""

import math
from typing import Any

import pandas as pd
import pytest

from nat2024_reports.layouts import groups_table

RUNS = [("a", "a", "none", "patch", 0.5, 0.6), ("a+g", "a", "g", "patch", 0.6, 0.5)]


def scores(*rows: tuple[str, str, int, float, str]) -> pd.DataFrame:
    columns = ["run", "attribute", "sequences", "success_auc", "provenance"]
    return pd.DataFrame(rows, columns=columns)


def test_groups_have_their_size_and_provenance(summary: Any) -> None:
    rows = scores(
        ("a", "IV", 9, 0.4, "published"),
        ("a", "UL", 1, 0.3, "computed"),
        ("a+g", "IV", 8, 0.45, "published"),
    )
    table = groups_table(summary(RUNS), rows, "attribute")
    page = table.for_page()
    assert page.headings == ("Tracker", "Enhancer", "all (135)", "IV (9)", "UL* (1)")
    assert [[cell.text for cell in row] for row in page.rows] == [
        ["a", "-", "0.500", "0.400", "0.300"],
        ["a", "g", "0.600", "0.450", "-"],
    ]
    assert [row[3].rank for row in page.rows] == [2, 1]
    assert table.footnotes == (
        "* computed from boxes and frames, not published",
        "UL: one sequence only",
        "not all sequences of every column: a+g",
    )
    assert table.caption.startswith("Success on uavdark_135")


def test_categories_and_other_scores(summary: Any) -> None:
    rows = scores(("a", "car", 3, 0.4, ""), ("a+g", "car", 3, 0.5, ""))
    rows = rows.rename(columns={"attribute": "category"}).assign(precision_20=[0.7, 0.8])
    table = groups_table(summary(RUNS), rows, "category", metric="precision_20")
    assert [row[2].text for row in table.rows] == ["0.600", "0.500"]
    assert [row[3].text for row in table.rows] == ["0.700", "0.800"]
    assert table.caption.startswith("Precision on")
    assert not table.footnotes


def test_intervals_are_shown_only_where_there_are_gains(summary: Any) -> None:
    rows = scores(("a", "IV", 4, 0.4, "published"))
    table = groups_table(summary(RUNS[:1]), rows, "attribute", intervals=True)
    assert table.for_page().headings == ("Tracker", "Enhancer", "all (135)", "IV (4)")
    assert {len(row) for row in table.rows} == {len(table.columns)}


def test_intervals_of_groups(summary: Any, gains: Any) -> None:
    rows = scores(("a", "IV", 4, 0.4, "published"), ("a+g", "IV", 4, 0.5, "published"))
    found = gains([("a+g", 25.0, -1.0, 40.0, False)], attribute="IV", sequences=4)
    table = groups_table(summary(RUNS), rows, "attribute", found, intervals=True)
    page = table.for_page()
    assert page.headings[3:] == ("IV (4)", "gain %", "95% interval", "better %")
    assert [cell.text for cell in list(page.rows)[1]][3:] == [
        *("0.500", "+25.000", "[-1.0, +40.0]", "60")
    ]
    assert table.footnotes == ("~ noise: 4 sequences are too few to tell a gain from chance",)
    quiet = groups_table(summary(RUNS), rows, "attribute", found)
    assert quiet.for_page().headings[3:] == ("IV (4)",)
    assert "IV gain low %" in [column.name for column in quiet.for_file().columns]


def test_no_groups(summary: Any) -> None:
    with pytest.raises(ValueError, match="no sequence has an attribute"):
        groups_table(summary(RUNS), scores(), "attribute")


def test_nan_is_a_dash(summary: Any) -> None:
    rows = scores(("a", "IV", 4, math.nan, "published"), ("a+g", "IV", 4, 0.5, "published"))
    table = groups_table(summary(RUNS), rows, "attribute")
    assert [(row[3].text, row[3].rank) for row in table.rows] == [("-", 0), ("0.500", 1)]
