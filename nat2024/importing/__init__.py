"""Results of other toolkits, read where they lie: folders or .zip archives, told by their shape.

One module a layout; `layouts` has the table. Nothing is unpacked, no pickle is opened.
"""

from nat2024.importing.layouts import (
    LAYOUTS,
    find_groups,
    find_runs,
    groups_of,
    is_results,
    nameless_groups,
    unread_files,
)
from nat2024.importing.names import TITLES, names_dataset, split_name
from nat2024.importing.origins import FirstRows, compare_first_rows
from nat2024.importing.runs import ForeignRun

__all__ = [
    "LAYOUTS",
    "TITLES",
    "FirstRows",
    "ForeignRun",
    "compare_first_rows",
    "find_groups",
    "find_runs",
    "groups_of",
    "is_results",
    "nameless_groups",
    "names_dataset",
    "split_name",
    "unread_files",
]
