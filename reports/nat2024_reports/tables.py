"""What stands in a table, whatever its layout and whatever format it is written in.

A layout makes a `Table`, a format writes one. Numbers follow the reference paper's Tables IV and
V: scores with three decimals, gains in percent of the tracker alone with three decimals, the best
of a column bold and the second underlined.
"""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal, TypeAlias

MARK = "~"
"""Stands after a number that may well be chance; a footnote says why."""

MISSING = "-"


@dataclass(frozen=True, slots=True)
class Column:
    """One column.

    Attributes:
        heading: for people.
        name: in files for programs; the heading where empty.
        is_words: whether it holds words, and not numbers.
        part: columns of one part stay together where a table is too wide for a page.
        where: "page" for people only, "file" for programs only.
    """

    heading: str
    name: str = ""
    is_words: bool = False
    part: str = ""
    where: Literal["all", "page", "file"] = "all"


@dataclass(frozen=True, slots=True)
class Cell:
    """One entry.

    Attributes:
        text: as people read it.
        value: the number in full precision, None where the text is all there is.
        rank: 1 for the best and 2 for the second, 0 for all others.
        is_doubtful: whether it may well be chance.
    """

    text: str
    value: float | None = None
    rank: int = 0
    is_doubtful: bool = False


Row: TypeAlias = tuple[Cell, ...]


@dataclass(frozen=True, slots=True)
class Table:
    """A table ready to be written in any format.

    Attributes:
        caption: what it shows, in one line.
        columns: one for each cell of a row; those of words come first.
        groups: rows, with a rule between groups.
        footnotes: lines below it.
        facts: what holds for all rows, such as dataset and protocol; columns of files for programs.
    """

    caption: str
    columns: tuple[Column, ...]
    groups: tuple[tuple[Row, ...], ...]
    footnotes: tuple[str, ...] = ()
    facts: Mapping[str, str] = field(default_factory=dict)

    @property
    def rows(self) -> Iterator[Row]:
        """All rows in order."""
        return (row for group in self.groups for row in group)

    @property
    def headings(self) -> tuple[str, ...]:
        """Headings of all columns."""
        return tuple(column.heading for column in self.columns)

    @property
    def words(self) -> int:
        """How many columns of words there are."""
        return sum(column.is_words for column in self.columns)

    def for_page(self) -> "Table":
        """The columns that people read."""
        return self.select(n for n, column in enumerate(self.columns) if column.where != "file")

    def for_file(self) -> "Table":
        """The columns that programs read."""
        return self.select(n for n, column in enumerate(self.columns) if column.where != "page")

    def select(self, numbers: Iterable[int]) -> "Table":
        """The same table with these columns only."""
        chosen = tuple(numbers)
        groups = tuple(
            tuple(tuple(row[number] for number in chosen) for row in group) for group in self.groups
        )
        columns = tuple(self.columns[number] for number in chosen)
        return replace(self, columns=columns, groups=groups)


def heading_lines(heading: str) -> list[str]:
    """A heading over numbers, broken at blanks but before a percent sign."""
    glued = heading.replace(" %", "\u00a0%").replace(" (%)", "\u00a0(%)")
    return glued.split(" ")


def words(text: str) -> Cell:
    """A cell of words."""
    return Cell(text)


def score(value: float, rank: int = 0, *, is_doubtful: bool = False) -> Cell:
    """A score with three decimals, or a dash where there is none."""
    text = MISSING if math.isnan(value) else f"{value:.3f}"
    return Cell(text, value, rank, is_doubtful)


def number(value: float, form: str = ".1f") -> Cell:
    """A number in the form given, or a dash where there is none."""
    return Cell(MISSING if math.isnan(value) else format(value, form), value)


def ranks(values: Sequence[float], digits: int = 3) -> list[int]:
    """1 for the best, 2 for the second, by what so many decimals show; 0 for all others."""
    shown = [round(value, digits) for value in values]
    order = sorted({value for value in shown if not math.isnan(value)}, reverse=True)
    if len(shown) < 2 or not order:
        return [0] * len(values)
    return [0 if math.isnan(value) else {0: 1, 1: 2}.get(order.index(value), 0) for value in shown]
