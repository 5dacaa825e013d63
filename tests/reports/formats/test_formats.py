"""The same table in every format."""

import csv
import io
import math
import re
import shutil
import subprocess
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from nat2024_reports import overall_table, render
from nat2024_reports.formats import fitting_parts
from nat2024_reports.layouts import enhancers_tables, sequences_table
from nat2024_reports.tables import Cell, Column, Table, number, score, words

NASTY = r"<script>alert('x')</script> & 50 % $x^2$ {a}_b ~ \end #1 | *bold* `code` -- é Ω"


def nasty() -> Table:
    """Words that mean something in every format, a doubtful number and a missing one."""
    columns = (Column(NASTY, is_words=True), Column("gain %"), Column("low", where="file"))
    rows = (
        (words(NASTY), Cell("-1.500", -1.5, 1, is_doubtful=True), number(-3.25)),
        (words("second"), score(math.nan), number(math.nan)),
    )
    return Table(NASTY, columns, (rows[:1], rows[1:]), (NASTY,), {"Dataset": NASTY})


def test_markdown(paper: pd.DataFrame) -> None:
    lines = render([overall_table(paper)], "markdown").splitlines()
    assert lines[0] == "uavdark_135: 135 sequences, 125466 frames; protocol pysot; scope patch"
    assert lines[2] == "| Tracker | Enhancer | Success | gain % | Precision | gain % |"
    assert lines[3] == "| --- | --- | ---: | ---: | ---: | ---: |"
    assert "| siamrpnpp | ldenhancer | **0.434** | +16.667 | **0.560** | +18.143 |" in lines
    assert "| siamrpnpp | sct | _0.421_ | +13.172 | _0.547_ | +15.401 |" in lines


def test_markdown_takes_nothing_for_markup() -> None:
    text = render([nasty()], "markdown")
    assert "<" not in text.replace("&lt;", "")
    body = [line for line in text.splitlines() if line.startswith("| ")]
    assert all(len(re.findall(r"(?<!\\)\|", line)) == 3 for line in body)
    assert r"\*bold\*" in text
    assert r"| \~**-1.500** |" in text


def test_csv_keeps_full_precision(summary: Any, paper: pd.DataFrame) -> None:
    rows = [("a", "a", "none", "patch", 1 / 3, 0.5), ("a+g", "a", "g", "patch", 2 / 3, 0.5)]
    text = render([overall_table(summary(rows)), overall_table(paper)], "csv")
    read = list(csv.DictReader(io.StringIO(text)))
    assert len(read) == 13
    assert float(read[1]["Success"]) == 2 / 3
    assert float(read[1]["Success gain %"]) == pytest.approx(100)
    assert read[0]["Success gain %"] == ""
    assert (read[0]["Dataset"], read[0]["Protocol"]) == ("uavdark_135", "pysot")
    assert [row["Scope"] for row in read[:2]] == ["", "patch"]


def test_csv_holds_what_pages_leave_out() -> None:
    first, second = csv.DictReader(io.StringIO(render([nasty()], "csv")))
    assert (first[NASTY], first["gain %"], first["low"]) == (NASTY, "-1.5", "-3.25")
    assert (second["gain %"], second["low"]) == ("", "")


class Page(HTMLParser):
    """Tags and text of a page."""

    def __init__(self) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.text = ""

    def handle_starttag(self, tag: str, attributes: Any) -> None:
        self.tags.append(tag)

    def handle_data(self, data: str) -> None:
        self.text += data


def test_html_escapes_and_marks() -> None:
    text = render([nasty()], "html")
    page = Page()
    page.feed(text)
    assert "script" not in page.tags
    assert page.text.count(NASTY) == 5  # title, caption, heading, cell, footnote
    assert text.count("<tbody>") == 2
    assert '<td><span class="doubtful"><b>-1.500</b>' in text
    assert page.tags.count("td") == 4
    assert not re.search(r"(src|href)=|url\(|@import", text)  # a page of its own


def test_latex_escapes_and_marks(paper: pd.DataFrame) -> None:
    text = render([overall_table(paper)], "latex")
    assert r"\caption{uavdark\_135: 135 sequences" in text
    assert r"gain~\%" in text
    assert r"siamrpnpp & ldenhancer & \textbf{0.434} & +16.667" in text
    assert r"\underline{0.421}" in text
    text = render([nasty()], "latex")
    assert r"\textcolor{gray}{\textbf{$-$1.500}}\rlap{$^\sim$}" in text
    assert r"é ?" in text  # no Greek in text
    assert r"-{}-" in text  # two signs, not one long dash
    assert r"\textless{}script\textgreater{}" in text


def long_table(count: int) -> Table:
    names = [f"sequence_{number}" for number in range(count)]
    fixed = {"dataset": "d", "protocol": "pysot", "run": "a", "tracker": "a"}
    more = {"enhancer": "none", "scope": "", "sequences": count, "frames": 5, "success_auc": 0.5}
    summary = pd.DataFrame([{**fixed, **more}])
    rows = [{**fixed, **more, "sequence": name} for name in names]
    return sequences_table(summary, pd.DataFrame(rows))


@pytest.mark.latex
@pytest.mark.skipif(shutil.which("pdflatex") is None, reason="no LaTeX on this machine")
def test_latex_compiles_alone(paper: pd.DataFrame, tmp_path: Path) -> None:
    tables = [overall_table(paper), *enhancers_tables(paper), nasty(), long_table(135)]
    (tmp_path / "table.tex").write_text(render(tables, "latex"))
    command = ["pdflatex", "-interaction=nonstopmode", "-halt-on-error", "table.tex"]
    subprocess.run(command, cwd=tmp_path, check=True, stdout=subprocess.DEVNULL)
    log = (tmp_path / "table.log").read_text(errors="replace")
    assert "Overfull \\hbox" not in log
    pages = re.search(r"\((\d+) pages", log)
    assert pages
    assert int(pages[1]) > 2  # the long one is broken, and not cut


def test_long_tables_may_be_broken() -> None:
    assert "longtable" not in render([long_table(20)], "latex").split(r"\begin{document}")[1]
    text = render([long_table(135)], "latex")
    assert text.count(r"\begin{longtable}") == 1
    assert "sequence\\_134" in text


def wide(count: int) -> Table:
    columns = [Column("Run", is_words=True)]
    for run in range(count):
        columns += [Column(f"score {run}", part=str(run)), Column("gain %", part=str(run))]
    row = (words("a" * 30), *(score(0.5) for _ in columns[1:]))
    return Table("wide", tuple(columns), ((row,),), ("note",))


def test_wide_tables_come_in_parts() -> None:
    parts = fitting_parts(wide(9))
    assert [part.caption for part in parts] == ["wide (1 of 3)", "wide (2 of 3)", "wide (3 of 3)"]
    assert [part.footnotes for part in parts] == [(), (), ("note",)]
    assert all(part.headings[0] == "Run" for part in parts)
    assert all(part.headings[-1] == "gain %" for part in parts)  # a gain stays with its score
    shown = [heading for part in parts for heading in part.headings[1:]]
    assert shown == list(wide(9).headings[1:])
    assert len(fitting_parts(wide(2))) == 1
    assert fitting_parts(wide(2))[0].caption == "wide"
    narrow = fitting_parts(wide(2), width=10)  # nothing fits: one part of a score each
    assert len(narrow) == 2


@pytest.mark.latex
@pytest.mark.skipif(shutil.which("pdflatex") is None, reason="no LaTeX on this machine")
def test_latex_tables_of_many_groups_stay_within_the_margins(tmp_path: Path) -> None:
    heads = ["Tracker", "Enhancer", *(f"{name} (17)" for name in ("ARV", "OCC", "DEF", "FCM") * 4)]
    columns = tuple(Column(head, is_words=number < 2) for number, head in enumerate(heads))
    row = (words("LightTrack"), words("LDEnhancer"), *(score(0.593, 1) for _ in heads[2:]))
    text = render([Table("Attributes", columns, ((row,),))], "latex")
    (tmp_path / "table.tex").write_text(text)
    subprocess.run(
        ["pdflatex", "-interaction=batchmode", "table.tex"], cwd=tmp_path, check=True, timeout=60
    )
    assert "Overfull" not in (tmp_path / "table.log").read_text()
