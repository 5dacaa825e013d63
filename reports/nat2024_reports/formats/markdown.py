"""Tables in GitHub's Markdown."""

from collections.abc import Iterable, Sequence

from nat2024_reports.tables import MARK, Cell, Table

_MARKS = ("{}", "**{}**", "_{}_")
_ESCAPES = str.maketrans(
    {
        "\\": r"\\",  # else one at the end of a name would free what stands behind it
        "|": r"\|",
        "*": r"\*",
        "`": r"\`",
        "<": "&lt;",
        "~": r"\~",
        "\n": " ",
        "\r": " ",
    }
)


def as_markdown(tables: Sequence[Table]) -> str:
    """Tables with their captions above and footnotes below."""
    return "\n".join(_one(table.for_page()) for table in tables)


def _one(table: Table) -> str:
    body = pipe_table(
        [_escape(heading) for heading in table.headings],
        [[_text(cell) for cell in row] for row in table.rows],
        table.words,
    )
    notes = "".join(f"\n{_escape(note)}\n" for note in table.footnotes)
    return f"{_escape(table.caption)}\n\n{body}{notes}"


def pipe_table(headings: Sequence[str], rows: Iterable[Sequence[str]], words: int = 1) -> str:
    """Lines of a table; the first `words` columns are words, the others numbers."""
    marks = ["---"] * words + ["---:"] * (len(headings) - words)
    return "".join(f"| {' | '.join(line)} |\n" for line in (headings, marks, *rows))


def _text(cell: Cell) -> str:
    text = _MARKS[cell.rank].format(_escape(cell.text))
    return f"{_escape(MARK)}{text}" if cell.is_doubtful else text


def _escape(text: str) -> str:
    return text.translate(_ESCAPES).replace("](", r"]\(")  # no link, and no picture from afar
