"""Writing score tables: Markdown for a page, CSV for a program, LaTeX for a paper."""

import csv
import io
import math
from collections.abc import Callable, Iterable, Sequence

from nat2024_reports.tables import Column, ScoreTable


def _as_markdown(tables: Sequence[ScoreTable]) -> str:
    return "\n".join(map(_markdown_table, tables))


def _markdown_table(table: ScoreTable) -> str:
    lines = [_pipes(table.headings), _alignment(table)]
    for row in table.rows:
        lines.append(_pipes(table.texts(row, ("{}", "**{}**", "_{}_"))))
    return f"{table.caption}\n\n" + "\n".join(lines) + "\n"


def _pipes(texts: Sequence[str]) -> str:
    return "| " + " | ".join(text.replace("|", r"\|") for text in texts) + " |"


def _alignment(table: ScoreTable) -> str:
    words, all_columns = len(table.word_headings), len(table.headings)
    return _pipes(["---"] * words + ["---:"] * (all_columns - words))


def _as_csv(tables: Sequence[ScoreTable]) -> str:
    """Numbers in full precision; one heading line over the rows of all tables."""
    columns = dict.fromkeys(column for table in tables for column in table.columns)
    scores = [text for column in columns for text in _csv_headings(column)]
    buffer = io.StringIO()
    writer = csv.DictWriter(
        buffer, ["Dataset", "Protocol", *tables[0].word_headings, *scores], lineterminator="\n"
    )
    writer.writeheader()
    for table in tables:
        for row in table.rows:
            record = dict(zip(table.word_headings, row.words, strict=True))
            for column, cell in zip(table.columns, row.cells, strict=True):
                numbers = (_number(cell.value), _number(cell.gain))
                record |= zip(_csv_headings(column), numbers, strict=False)
            writer.writerow({"Dataset": table.dataset, "Protocol": table.protocol, **record})
    return buffer.getvalue()


def _csv_headings(column: Column) -> tuple[str, ...]:
    return (column.heading, f"{column.heading} gain %")[: 1 + column.gain]


def _number(value: float) -> str:
    return "" if math.isnan(value) else repr(value)


def _as_latex(tables: Sequence[ScoreTable]) -> str:
    """Booktabs tables inside a document of their own, so that it compiles alone."""
    lines = [r"\documentclass{article}", r"\usepackage{booktabs}", r"\begin{document}"]
    for table in tables:
        lines += _latex_table(table)
    return "\n".join([*lines, r"\end{document}", ""])


def _latex_table(table: ScoreTable) -> list[str]:
    words = len(table.word_headings)
    columns = "l" * words + "r" * (len(table.headings) - words)
    lines = [
        r"\begin{table}",
        r"\centering",
        rf"\caption{{{_escape(table.caption)}}}",
        rf"\begin{{tabular}}{{{columns}}}",
        r"\toprule",
        " & ".join(map(_escape, table.headings)) + r" \\",
    ]
    for group in table.groups:
        lines.append(r"\midrule")
        for row in group:
            texts = table.texts(row, ("{}", r"\textbf{{{}}}", r"\underline{{{}}}"))
            lines.append(" & ".join([*map(_escape, row.words), *texts[words:]]) + r" \\")
    return [*lines, r"\bottomrule", r"\end{tabular}", r"\end{table}"]


_LATEX = str.maketrans(
    {
        "\\": r"\textbackslash{}",
        "&": r"\&",
        "%": r"\%",
        "$": r"\$",
        "#": r"\#",
        "_": r"\_",
        "{": r"\{",
        "}": r"\}",
        "~": r"\textasciitilde{}",
        "^": r"\textasciicircum{}",
    }
)


def _escape(text: str) -> str:
    return text.translate(_LATEX)


_WRITERS: dict[str, Callable[[Sequence[ScoreTable]], str]] = {
    "markdown": _as_markdown,
    "csv": _as_csv,
    "latex": _as_latex,
}

FORMATS = tuple(_WRITERS)
"""Formats that `render` knows."""


def render(tables: Iterable[ScoreTable], form: str) -> str:
    """Write tables as "markdown", "csv" (full precision) or "latex" (compiles alone)."""
    return _WRITERS[form](list(tables))
