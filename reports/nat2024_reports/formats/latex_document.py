"""Tables as a LaTeX document of booktabs tables that compiles alone."""

import re
import unicodedata
from collections.abc import Sequence

from nat2024_reports.formats.widths import fitting_parts
from nat2024_reports.tables import Cell, Table, heading_lines

_WIDTH = 97
"""Letters on a line of the page below, in small print and with the gaps of its columns."""

_LONGEST = 40
"""Rows of a table that floats; longer ones go over several pages."""

_HEAD = r"""\documentclass{article}
\usepackage[utf8]{inputenc}
\usepackage[a4paper,margin=2cm]{geometry}
\usepackage{booktabs,longtable,xcolor}
\setlength{\tabcolsep}{5pt}
\begin{document}
"""
_MARKS = ("{}", r"\textbf{{{}}}", r"\underline{{{}}}")
_ESCAPES = str.maketrans(
    {
        "\\": r"\textbackslash{}",
        "&": r"\&",
        "%": r"\%",
        "$": r"\$",
        "#": r"\#",
        "_": r"\_",
        "{": r"\{",
        "}": r"\}",
        "<": r"\textless{}",
        ">": r"\textgreater{}",
        "|": r"\textbar{}",
        '"': "''",
        "~": r"$\sim$",
        "^": r"\textasciicircum{}",
        "\u00a0": "~",
        "±": r"$\pm$",
        "Δ": r"$\Delta$",
        "ₛ": r"\textsubscript{s}",
        "ₚ": r"\textsubscript{p}",
    }
)


def as_latex(tables: Sequence[Table]) -> str:
    """Tables inside a document of their own; too wide ones in several."""
    lines: list[str] = []
    for table in tables:
        for part in fitting_parts(table, _WIDTH):
            lines += _long(part) if sum(1 for _ in part.rows) > _LONGEST else _floating(part)
    return _HEAD + "\n".join([*lines, r"\end{document}", ""])


def _floating(table: Table) -> list[str]:
    return [
        r"\begin{table}[htbp]",
        r"\centering\small",
        rf"\caption{{{_escape(table.caption)}}}",
        rf"\begin{{tabular}}{{{_alignment(table)}}}",
        r"\toprule",
        *_heading(table),
        *_body(table),
        r"\bottomrule",
        r"\end{tabular}",
        *(
            [rf"\\[3pt]\parbox{{0.9\linewidth}}{{\footnotesize {_notes(table)}}}"]
            if table.footnotes
            else []
        ),
        r"\end{table}",
    ]


def _long(table: Table) -> list[str]:
    return [
        r"{\small",
        rf"\begin{{longtable}}{{{_alignment(table)}}}",
        rf"\caption{{{_escape(table.caption)}}}\\",
        r"\toprule",
        *_heading(table),
        r"\midrule",
        r"\endhead",
        r"\bottomrule",
        r"\endfoot",
        *_body(table)[1:],
        r"\end{longtable}",
        rf"\noindent{{\footnotesize {_notes(table)}}}",
        "}",
    ]


def _alignment(table: Table) -> str:
    return "l" * table.words + "r" * (len(table.columns) - table.words)


def _heading(table: Table) -> list[str]:
    """Headings; those of numbers break at blanks, as `fitting_parts` counts them."""
    stacks = [
        [column.heading] if column.is_words else heading_lines(column.heading)
        for column in table.columns
    ]
    height = max(map(len, stacks), default=1)
    padded = [[""] * (height - len(stack)) + stack for stack in stacks]
    return [" & ".join(map(_escape, line)) + r" \\" for line in zip(*padded, strict=True)]


def _body(table: Table) -> list[str]:
    lines = []
    for group in table.groups:
        lines.append(r"\midrule")
        for row in group:
            texts = [*map(_text, row[: table.words]), *map(_number, row[table.words :])]
            lines.append(" & ".join(texts) + r" \\")
    return lines


def _notes(table: Table) -> str:
    return r"\\ ".join(map(_escape, table.footnotes))


def _number(cell: Cell) -> str:
    return re.sub(r"(?<![\w.])-(?=\d)", "$-$", _text(cell))


def _text(cell: Cell) -> str:
    text = _MARKS[cell.rank].format(_escape(cell.text))
    # the mark takes no room, so that digits stay below each other
    return rf"\textcolor{{gray}}{{{text}}}\rlap{{$^\sim$}}" if cell.is_doubtful else text


def _escape(text: str) -> str:
    found = "".join(_known(letter) for letter in text).translate(_ESCAPES)
    return re.sub(r"--+", lambda dashes: "{}".join(dashes[0]), found)


def _known(letter: str) -> str:
    """The letter, or `?` where pdfLaTeX has none in its usual font."""
    if letter.isascii():
        return letter if letter.isprintable() else " "
    if ord(letter) in _ESCAPES:
        return letter
    base = unicodedata.normalize("NFD", letter)[0]
    return letter if ord(letter) < 0x180 and base.isascii() and base.isalpha() else "?"
