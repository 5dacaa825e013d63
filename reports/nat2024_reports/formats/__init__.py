"""Writing tables: Markdown and HTML for a page, CSV for a program, LaTeX for a paper."""

from collections.abc import Callable, Iterable, Sequence

from nat2024_reports.formats.csv_file import as_csv
from nat2024_reports.formats.html_page import as_html
from nat2024_reports.formats.latex_document import as_latex
from nat2024_reports.formats.markdown import as_markdown
from nat2024_reports.formats.widths import fitting_parts
from nat2024_reports.tables import Table

__all__ = ["FORMATS", "fitting_parts", "render"]

_WRITERS: dict[str, Callable[[Sequence[Table]], str]] = {
    "markdown": as_markdown,
    "csv": as_csv,
    "latex": as_latex,
    "html": as_html,
}

FORMATS = tuple(_WRITERS)
"""Formats that `render` knows."""


def render(tables: Iterable[Table], form: str) -> str:
    """Write tables as "markdown", "csv" (full precision), "latex" (compiles alone) or "html"."""
    return _WRITERS[form](list(tables))
