"""Tables and figures of a night-tracking paper, from stored scores."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from nat2024_reports.dataset_tables import statistics_markdown
    from nat2024_reports.formats import FORMATS, render
    from nat2024_reports.gains import relative_gain
    from nat2024_reports.layouts import overall_table
    from nat2024_reports.tables import Table

_HOMES = {
    "FORMATS": "formats",
    "Table": "tables",
    "overall_table": "layouts",
    "relative_gain": "gains",
    "render": "formats",
    "statistics_markdown": "dataset_tables",
}

__all__ = [
    "FORMATS",
    "Table",
    "overall_table",
    "relative_gain",
    "render",
    "statistics_markdown",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        msg = f"module 'nat2024_reports' has no attribute {name!r}"
        raise AttributeError(msg)
    return getattr(import_module(f"nat2024_reports.{_HOMES[name]}"), name)
