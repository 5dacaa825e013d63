"""One self-contained HTML page that shows why a number is what it is."""

from nat2024_reports.page.document import build_page
from nat2024_reports.page.model import (
    Column,
    DatasetPart,
    FailureTable,
    LightCurve,
    Page,
    ProtocolScores,
    Run,
    SequencePart,
    Subset,
    Thumbnail,
    Track,
)

__all__ = [
    "Column",
    "DatasetPart",
    "FailureTable",
    "LightCurve",
    "Page",
    "ProtocolScores",
    "Run",
    "SequencePart",
    "Subset",
    "Thumbnail",
    "Track",
    "build_page",
]
