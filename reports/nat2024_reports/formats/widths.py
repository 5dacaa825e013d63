"""Tables that are wider than a page, in parts that are not."""

from collections.abc import Iterator
from dataclasses import replace
from unicodedata import east_asian_width

from nat2024_reports.tables import Cell, Table, heading_lines

_GAP = 2
"""Blanks beside a column."""


def fitting_parts(table: Table, width: int = 100) -> list[Table]:
    """The columns that people read, in as few tables as are at most `width` letters wide.

    Each has the columns of words; columns of one part of a score stay together. A part that is
    too wide alone stays as it is. Footnotes are below the last.
    """
    page = table.for_page()
    widths = [_width(page, number) + _GAP for number in range(len(page.columns))]
    fixed = list(range(page.words))
    left = width - sum(widths[number] for number in fixed)
    lines: list[list[int]] = [[]]
    for block in _blocks(page):
        needed = sum(widths[number] for number in block)
        if lines[-1] and sum(widths[number] for number in lines[-1]) + needed > left:
            lines.append([])
        lines[-1] += block
    parts = [page.select([*fixed, *line]) for line in lines]
    return [_numbered(part, number, len(parts)) for number, part in enumerate(parts, start=1)]


def _numbered(table: Table, number: int, count: int) -> Table:
    part = f" ({number} of {count})" if count > 1 else ""
    notes = table.footnotes if number == count else ()
    return replace(table, caption=table.caption + part, footnotes=notes)


def _blocks(table: Table) -> Iterator[list[int]]:
    """Numbers of the columns that stay together."""
    block: list[int] = []
    for number in range(table.words, len(table.columns)):
        part = table.columns[number].part
        if block and not (part and part == table.columns[block[-1]].part):
            yield block
            block = []
        block.append(number)
    if block:
        yield block


def _width(table: Table, number: int) -> int:
    column = table.columns[number]
    heads = [column.heading] if column.is_words else heading_lines(column.heading)
    cells = (_letters(row[number]) for row in table.rows)
    return max([*map(len, heads), *cells], default=0)


def _letters(cell: Cell) -> int:
    wide = sum(east_asian_width(letter) in "WF" for letter in cell.text)
    return len(cell.text) + wide + cell.is_doubtful
