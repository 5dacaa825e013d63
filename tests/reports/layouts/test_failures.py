import math

import pandas as pd
import pytest

from nat2024_reports import render
from nat2024_reports.layouts.failures import failures_table, losses_table

NAN = math.nan
COLUMNS = {
    "run": ["t", "t", "t+<e>", "t+<e>"],
    "tracker": ["t"] * 4,
    "enhancer": ["none", "none", "<e>", "<e>"],
    "sequence": ["a", "b", "a", "b"],
    "frames": [100, 300, 100, 300],
    "absent": [0, 0, 0, 0],
    "first_loss": [10, 30, None, None],
    "losses": [2, 1, 0, 0],
    "lost": [40, 20, 0, 0],
    "recoveries": [1, 0, 0, 0],
    "drift": [1.5, NAN, NAN, NAN],
    "longest": [50, 280, 100, 300],
    "luminance_at_loss": [0.2, 0.3, NAN, NAN],
    "unevenness_at_loss": [0.9, 0.5, NAN, NAN],
    "over_enhancement_at_loss": [NAN] * 4,
}


@pytest.fixture
def failures() -> pd.DataFrame:
    return pd.DataFrame(COLUMNS).astype({"first_loss": "Int64"})


def test_a_run_is_summed_up_over_its_sequences(failures: pd.DataFrame) -> None:
    table = failures_table(failures, "d", 10, ["said"])
    names = [column.name or column.heading for column in table.columns]
    plain, enhanced = (dict(zip(names, row, strict=True)) for row in table.rows)
    assert plain["sequences_lost"].value == 2
    assert plain["first_loss"].value == 20
    assert plain["lost_percent"].value == pytest.approx(15.0)
    assert plain["drift"].text == "1.50"  # the sequence whose drift is not known is left out
    assert plain["luminance_at_loss"].text == "0.250"
    assert plain["over_enhancement_at_loss"].text == "-"
    assert (enhanced["losses"].text, enhanced["first_loss"].text) == ("0", "-")
    assert enhanced["Enhancer"].text == "<e>"
    assert table.footnotes[-1] == "said"


def test_losses_are_listed_by_sequence_and_the_others_counted(failures: pd.DataFrame) -> None:
    table = losses_table(failures, "d", 10)
    assert [row[0].text for row in table.rows] == ["a", "b"]
    assert [len(group) for group in table.groups] == [1, 1]
    assert "never lost: 2 of 4 tracked sequences" in table.footnotes


@pytest.mark.parametrize("form", ["markdown", "csv", "latex", "html"])
def test_every_format_writes_them(failures: pd.DataFrame, form: str) -> None:
    text = render([failures_table(failures, "d", 10), losses_table(failures, "d", 10)], form)
    assert "0.70" in text or "0.7" in text
    if form == "html":
        assert "<e>" not in text


def test_nothing_lost_and_nothing_at_all(failures: pd.DataFrame) -> None:
    assert not list(losses_table(failures.iloc[2:], "d", 10).rows)
    assert not list(failures_table(failures.iloc[:0], "d", 10).rows)
