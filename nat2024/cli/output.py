"""Printing results: tables for people, JSON for programs, always on standard output."""

import math
from collections.abc import Collection, Iterable, Sequence
from typing import TYPE_CHECKING, Any

import click
import msgspec

if TYPE_CHECKING:
    import pandas as pd

_WIDTH = 100
_SHORT_NAME = 24


def print_json(document: Any) -> None:
    """Print one JSON object; NaN and infinite numbers become null."""
    click.echo(json_text(document), nl=False)


def json_text(document: Any) -> str:
    """Text of one JSON object, with a line end; NaN and infinite numbers become null."""
    plain = _without_nan(msgspec.to_builtins(document, enc_hook=str))
    return msgspec.json.format(msgspec.json.encode(plain), indent=2).decode() + "\n"


def _without_nan(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _without_nan(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_without_nan(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def rows_of(frame: "pd.DataFrame") -> list[dict[str, Any]]:
    """Rows of a table as plain dictionaries."""
    return frame.astype(object).to_dict(orient="records")  # type: ignore[return-value]


def table_width() -> int:
    """Columns that a table may take: 100, or those of a narrower terminal."""
    from rich.console import Console

    console = Console()
    return min(_WIDTH, console.width) if console.is_terminal else _WIDTH


def print_table(
    headings: Sequence[str],
    rows: Iterable[Sequence[str]],
    *,
    title: str = "",
    words: int = 1,
    styles: Sequence[Sequence[str]] = (),
    rules: Collection[int] = (),
) -> None:
    """Print an aligned table; the first `words` columns are words, the others numbers.

    Short names in the first column are never broken, so that they can be copied.

    Args:
        headings: of the columns.
        rows: texts.
        title: above it.
        words: number of columns of words.
        styles: of the cells of each row, such as "bold"; seen on terminals only.
        rules: numbers of the rows after which a gap is left.
    """
    from rich.box import SIMPLE_HEAD
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(
        box=SIMPLE_HEAD,
        pad_edge=False,
        padding=(0, 1, 0, 0),
    )
    texts = [list(row) for row in rows]
    short = max((len(row[0]) for row in texts), default=0) <= _SHORT_NAME
    for number, heading in enumerate(headings):
        if number < words:
            no_wrap = number == 0 and short
            table.add_column(Text(heading), overflow="fold", no_wrap=no_wrap)
        else:  # numbers keep their width, so their headings break at every blank
            table.add_column(Text(heading.replace(" ", "\n")), justify="right", no_wrap=True)
    for number, row in enumerate(texts):
        looks = styles[number] if styles else [""] * len(row)
        cells = [Text(text, style=look) for text, look in zip(row, looks, strict=True)]
        table.add_row(*cells, end_section=number in rules)
    console = Console(highlight=False, width=table_width())
    if title:  # not the table's own, which would be broken where the table is narrow
        console.print(Text(title, style="italic"))
    console.print(table)
