"""Stored results in the layouts of other toolkits, in nat-bench's own, or as one file.

One module a layout; `formats` has the table. Any results that `nat2024.store` can list are taken,
so that exporting foreign ones to the format `nat-bench` is an import.
"""

from nat2024.exporting.exports import ExportedRun, ExportReport, export_results
from nat2024.exporting.formats import FORMATS, Format

__all__ = ["FORMATS", "ExportReport", "ExportedRun", "Format", "export_results"]
