"""Names of strangers in tables, on terminals and on the way to a folder."""

import io
import sys

import pytest

from nat2024.cli.terminal import harmless_terminal, shown
from nat2024_reports.formats import render
from nat2024_reports.tables import Cell, Column, Table


def table(name: str) -> Table:
    columns = (Column("Tracker", is_words=True), Column("Success"))
    return Table("Scores", columns, (((Cell(name), Cell("0.5", 0.5)),),), facts={"dataset": name})


@pytest.mark.parametrize("name", ["=cmd|' /C calc'!A0", "@SUM(1)", "+a1", "-a1", "\tx"])
def test_csv_has_no_formulas(name: str) -> None:
    import csv

    (row,) = csv.DictReader(io.StringIO(render([table(name)], "csv"), newline=""))
    assert row["Tracker"] == row["dataset"] == f"'{name}"


def test_csv_has_one_row_a_line() -> None:
    assert render([table("a\r=b\nc")], "csv").endswith("a =b c,a =b c,0.5\n")


@pytest.mark.parametrize("name", ["siamrpnpp+ldenhancer", "-", "-1.5", "a=b", "fdsst@x"])
def test_csv_keeps_all_other_names(name: str) -> None:
    assert f"{name},{name},0.5" in render([table(name)], "csv")


def test_markdown_has_no_links_and_keeps_its_columns() -> None:
    text = render([table("![a](http://x) \\| <b>\r\n\\")], "markdown")
    row = text.rstrip("\n").rsplit("\n", 1)[-1]
    assert "](" not in row
    assert "<b" not in row
    assert row.endswith("\\\\ | 0.5 |")  # the last backslash frees no pipe
    assert row.startswith(r"| ![a]\(http://x) \\\| &lt;b>")


@pytest.mark.parametrize("name", [r"\input{/etc/passwd}", r"\write18{id}", "a^^5cinput", "%\n\\x"])
def test_latex_has_no_commands(name: str) -> None:
    text = render([table(name)], "latex")
    for command in (r"\input", r"\write", "^^", "\\x"):
        assert command not in text.replace(r"\xcolor", "")


def test_html_has_no_elements() -> None:
    text = render([table("</td><script>alert(1)</script><img src=x onerror=y>")], "html")
    assert "<script" not in text
    assert "<img" not in text


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


NAME = "a\x1b[2Jb\x1b]0;title\x07c\x9b1Ad\re\u202ef"


def test_a_terminal_is_not_steered(monkeypatch: pytest.MonkeyPatch) -> None:
    import click

    terminal = Terminal()
    monkeypatch.setattr(sys, "stdout", terminal)
    with harmless_terminal():
        click.echo(NAME)
        sys.stdout.writelines(["\x1b[1mbold\x1b[0m\ttab\n"])
    assert sys.stdout is terminal
    told, bold, _ = terminal.getvalue().split("\n")
    assert told == r"a\x1b[2Jb\x1b]0;title\x07c\x9b1Ad\re\u202ef"
    assert bold == "\x1b[1mbold\x1b[0m\ttab"


def test_a_progress_bar_goes_back_in_its_line(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    with harmless_terminal():
        sys.stderr.write("\r50% a\rb")
    assert terminal.getvalue() == "\r50% a\\rb"


def test_pipes_get_every_letter(monkeypatch: pytest.MonkeyPatch) -> None:
    pipe = io.StringIO()
    monkeypatch.setattr(sys, "stdout", pipe)
    with harmless_terminal():
        sys.stdout.write(NAME)
    assert pipe.getvalue() == NAME


def test_the_command_line_prints_so(monkeypatch: pytest.MonkeyPatch) -> None:
    from nat2024.cli import run

    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    assert run(["eval", "--results", "\x1b[2Jnowhere"]) == 2
    assert "\x1b" not in terminal.getvalue()
    assert r"\x1b[2Jnowhere" in terminal.getvalue()


def test_only_what_steers_is_changed() -> None:
    assert shown("Größe 夜 \x1b[31mred\x1b[0m\n\t") == "Größe 夜 \x1b[31mred\x1b[0m\n\t"
