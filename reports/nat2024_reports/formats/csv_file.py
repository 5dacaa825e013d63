"""Tables as one CSV file."""

import csv
import io
import math
import re
from collections.abc import Sequence

from nat2024_reports.tables import Cell, Column, Table

_FORMULA = re.compile(r"[=@\t]|[+-](?![\d.]*$)")


def as_csv(tables: Sequence[Table]) -> str:
    """Numbers in full precision; one heading line over the rows of all tables."""
    files = [table.for_file() for table in tables]
    facts = dict.fromkeys(fact for table in files for fact in table.facts)
    names = dict.fromkeys(_name(column) for table in files for column in table.columns)
    buffer = io.StringIO()
    writer = csv.DictWriter(buffer, [*facts, *names], lineterminator="\n")
    writer.writeheader()
    for table in files:
        for row in table.rows:
            pairs = zip(table.columns, row, strict=True)
            cells = {_name(column): _text(cell) for column, cell in pairs}
            told = {name: _quoted(text) for name, text in table.facts.items()}
            writer.writerow({**told, **cells})
    return buffer.getvalue()


def _name(column: Column) -> str:
    return column.name or column.heading


def _quoted(text: str) -> str:
    """The text in one line, behind an apostrophe where a spreadsheet would see a formula."""
    text = " ".join(re.split(r"[\r\n]", text))
    return f"'{text}" if _FORMULA.match(text) else text


def _text(cell: Cell) -> str:
    if cell.value is None:
        return _quoted(cell.text)
    return "" if math.isnan(cell.value) else repr(cell.value)
