"""Enhancers before one tracker: the reference paper's Table IV, digit by digit."""

from typing import Any

import pandas as pd
import pytest

from nat2024_reports.layouts import enhancers_tables

# Table IV of the paper: success, precision, and their gains in percent
TABLE_IV = {
    "RUAS": ("0.381", "+2.419", "0.490", "+3.376"),
    "KinD++": ("0.386", "+3.763", "0.485", "+2.321"),
    "LIME": ("0.393", "+5.645", "0.501", "+5.696"),
    "EnlightenGAN": ("0.397", "+6.720", "0.505", "+6.540"),
    "LLVE": ("0.397", "+6.720", "0.508", "+7.173"),
    "DCE++": ("0.402", "+8.065", "0.512", "+8.017"),
    "DarkLighter": ("0.385", "+3.495", "0.495", "+4.430"),
    "HighlightNet": ("0.376", "+1.075", "0.483", "+1.899"),
    "SCT": ("0.421", "+13.172", "0.547", "+15.401"),
    "LDEnhancer": ("0.434", "+16.667", "0.560", "+18.143"),
}
NAMES = {
    **{"ruas": "RUAS", "kindpp": "KinD++", "lime": "LIME", "enlightengan": "EnlightenGAN"},
    **{"llve": "LLVE", "dcepp": "DCE++", "darklighter": "DarkLighter", "sct": "SCT"},
    **{"highlightnet": "HighlightNet", "ldenhancer": "LDEnhancer", "siamrpnpp": "SiamRPN++"},
}


def test_table_iv_digit_by_digit(paper: pd.DataFrame) -> None:
    (table,) = enhancers_tables(paper, names=NAMES)
    page = table.for_page()
    assert page.headings == ("Enhancer", "Succ.", "gain %", "Prec.", "gain %")
    found = {row[0].text: tuple(cell.text for cell in row[1:]) for row in page.rows}
    assert found == {
        "SiamRPN++": ("0.372", "-", "0.474", "-"),
        **{f"+{name}": cells for name, cells in TABLE_IV.items()},
    }
    assert table.caption.startswith("Enhancers before SiamRPN++ on uavdark_135: 135 sequences")


def test_best_is_last_and_bold_second_is_underlined(paper: pd.DataFrame) -> None:
    (table,) = enhancers_tables(paper, names=NAMES)
    rows = list(table.for_page().rows)
    assert rows[0][0].text == "SiamRPN++"
    assert [row[0].text for row in rows[-2:]] == ["+SCT", "+LDEnhancer"]
    assert [cell.rank for cell in rows[-1][1:]] == [1, 1, 1, 1]
    assert [cell.rank for cell in rows[-2][1:]] == [2, 2, 2, 2]
    assert {cell.rank for row in rows[:-2] for cell in row} == {0}


def test_one_table_for_each_tracker_and_scope(summary: Any) -> None:
    rows = [
        ("a", "a", "none", "patch", 0.5, 0.5),
        ("a+g", "a", "g", "patch", 0.6, 0.6),
        ("a+h", "a", "h", "frame", 0.7, 0.7),
        ("b+g", "b", "g", "patch", 0.7, 0.7),
        ("c", "c", "none", "patch", 0.7, 0.7),
    ]
    tables = enhancers_tables(summary(rows))
    assert [[row[0].text for row in table.rows] for table in tables] == [
        ["a", "+h"],
        ["a", "+g"],
        ["+g"],
    ]
    assert [table.caption.rpartition("; ")[2] for table in tables] == [
        "scope frame",
        "scope patch",
        "scope patch",
    ]
    assert tables[2].footnotes == ("no gains of b: not run without an enhancer",)
    assert [cell.text for cell in next(tables[2].for_page().rows)] == [
        *("+g", "0.700", "-", "0.700", "-")
    ]
    with pytest.raises(ValueError, match="no scores"):
        enhancers_tables(summary([]))
