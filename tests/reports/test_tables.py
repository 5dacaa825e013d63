"""Score tables: what stands in them, and the same numbers in every format."""

import csv
import io
import math
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from nat2024_reports import overall_table, render

COLUMNS = ("run", "tracker", "enhancer", "scope", "success_auc", "precision_20")


def summary(rows: list[tuple[Any, ...]], **changes: Any) -> pd.DataFrame:
    frame = pd.DataFrame(rows, columns=list(COLUMNS))
    fixed = {"dataset": "uavdark_135", "protocol": "pysot", "sequences": 135, "frames": 125466}
    missing = {"normalized_precision_20": math.nan, "normalized_precision_auc": math.nan}
    return frame.assign(**{**fixed, **missing, **changes})


PAPER = summary(
    [
        ("siamrpnpp+sct", "siamrpnpp", "sct", "patch", 0.421, 0.547),
        ("siamrpnpp", "siamrpnpp", "none", "patch", 0.372, 0.474),
        ("siamrpnpp+ldenhancer", "siamrpnpp", "ldenhancer", "patch", 0.434, 0.560),
        ("siamrpnpp+lime", "siamrpnpp", "lime", "patch", 0.393, 0.501),
    ]
)


def test_rows_gains_and_ranks() -> None:
    table = overall_table(PAPER)
    (group,) = table.groups
    assert [row.words for row in group] == [
        ("siamrpnpp", "-", ""),
        ("siamrpnpp", "ldenhancer", "patch"),
        ("siamrpnpp", "lime", "patch"),
        ("siamrpnpp", "sct", "patch"),
    ]
    success = [(row.cells[0].score, row.cells[0].gain_text) for row in group]
    assert success == [
        ("0.372", ""),
        ("0.434", "+16.667"),
        ("0.393", "+5.645"),
        ("0.421", "+13.172"),
    ]
    assert [row.cells[0].rank for row in group] == [0, 1, 0, 2]
    assert table.headings == (
        "Tracker",
        "Enhancer",
        "Scope",
        "Success",
        "gain %",
        "Precision",
        "gain %",
    )


def test_scopes_are_never_compared_with_each_other() -> None:
    rows = [
        ("a", "a", "none", "patch", 0.5, 0.5),
        ("a+g", "a", "g", "patch", 0.6, 0.6),
        ("a+h", "a", "h", "frame", 0.7, 0.7),
    ]
    groups = overall_table(summary(rows)).groups
    assert [[row.words[1] for row in group] for group in groups] == [["-", "h"], ["g"]]
    assert [group[-1].cells[0].rank for group in groups] == [1, 0]


def test_without_the_plain_tracker_there_is_no_gain() -> None:
    (group,) = overall_table(summary([("a+g", "a", "g", "patch", 0.6, 0.6)])).groups
    assert group[0].cells[0].gain_text == ""
    assert group[0].cells[0].rank == 0


def test_equal_to_three_decimals_is_equally_good() -> None:
    rows = [
        ("a", "a", "none", "patch", 0.50001, 0.1),
        ("a+g", "a", "g", "patch", 0.50004, 0.2),
        ("a+h", "a", "h", "patch", 0.4, math.nan),
    ]
    (group,) = overall_table(summary(rows)).groups
    assert [row.cells[0].rank for row in group] == [1, 1, 2]
    assert [row.cells[1].rank for row in group] == [2, 1, 0]
    assert group[2].cells[1].score == "-"


def test_datasets_and_protocols_are_not_mixed() -> None:
    with pytest.raises(ValueError, match="several values of protocol"):
        overall_table(PAPER.assign(protocol=["pysot", "otb", "pysot", "pysot"]))
    with pytest.raises(ValueError, match="no scores"):
        overall_table(PAPER.iloc[:0])


def test_markdown() -> None:
    lines = render([overall_table(PAPER)], "markdown").splitlines()
    assert lines[0] == "uavdark_135: 135 sequences, 125466 frames; protocol pysot"
    assert lines[2] == "| Tracker | Enhancer | Scope | Success | gain % | Precision | gain % |"
    assert lines[3] == "| --- | --- | --- | ---: | ---: | ---: | ---: |"
    assert lines[5] == (
        "| siamrpnpp | ldenhancer | patch | **0.434** | +16.667 | **0.560** | +18.143 |"
    )
    assert "_0.421_" in lines[7]


def test_csv_keeps_full_precision() -> None:
    rows = [("a", "a", "none", "patch", 1 / 3, 0.5), ("a+g", "a", "g", "patch", 2 / 3, 0.5)]
    text = render([overall_table(summary(rows)), overall_table(PAPER)], "csv")
    read = list(csv.DictReader(io.StringIO(text)))
    assert len(read) == 6
    assert float(read[1]["Success"]) == 2 / 3
    assert float(read[1]["Success gain %"]) == pytest.approx(100)
    assert read[0]["Success gain %"] == ""


def test_latex_escapes_and_marks() -> None:
    text = render([overall_table(PAPER)], "latex")
    assert r"\caption{uavdark\_135: 135 sequences" in text
    assert r"gain \%" in text
    assert r"siamrpnpp & ldenhancer & patch & \textbf{0.434} & +16.667" in text
    assert r"\underline{0.421}" in text


@pytest.mark.skipif(shutil.which("pdflatex") is None, reason="no LaTeX on this machine")
def test_latex_compiles_alone(tmp_path: Path) -> None:
    (tmp_path / "table.tex").write_text(render([overall_table(PAPER)], "latex"))
    command = ["pdflatex", "-interaction=nonstopmode", "-halt-on-error", "table.tex"]
    subprocess.run(command, cwd=tmp_path, check=True, stdout=subprocess.DEVNULL)


def test_no_gain_over_another_set_of_sequences() -> None:
    rows = [("a", "a", "none", "patch", 0.5, 0.5), ("a+g", "a", "g", "patch", 0.6, 0.6)]
    (group,) = overall_table(summary(rows, sequences=[3, 2])).groups
    assert group[1].cells[0].gain_text == ""
