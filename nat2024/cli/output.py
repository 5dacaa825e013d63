"""Printing results: tables for people, JSON for programs, always on standard output."""

import math
from collections.abc import Iterable, Sequence
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


def print_table(
    headings: Sequence[str], rows: Iterable[Sequence[str]], *, title: str = "", words: int = 1
) -> None:
    """Print an aligned table; the first `words` columns are words, the others numbers.

    Short names in the first column are never broken, so that they can be copied.
    """
    from rich.box import SIMPLE_HEAD
    from rich.console import Console
    from rich.table import Table

    table = Table(
        box=SIMPLE_HEAD,
        title=_escape(title) if title else None,
        title_justify="left",
        pad_edge=False,
        padding=(0, 1, 0, 0),
    )
    texts = [[_escape(text) for text in row] for row in rows]
    short = max((len(row[0]) for row in texts), default=0) <= _SHORT_NAME
    for number, heading in enumerate(headings):
        if number < words:
            table.add_column(heading, overflow="fold", no_wrap=number == 0 and short)
        else:  # numbers keep their width, so their headings break at every blank
            table.add_column(heading.replace(" ", "\n"), justify="right", no_wrap=True)
    for row in texts:
        table.add_row(*row)
    console = Console(highlight=False)
    console.width = min(_WIDTH, console.width) if console.is_terminal else _WIDTH
    console.print(table)


def _escape(text: str) -> str:
    from rich.markup import escape

    return escape(text)
