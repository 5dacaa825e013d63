"""Tables that describe a dataset, in Markdown; numbers in, text out."""

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from nat2024_reports.formats.markdown import pipe_table

if TYPE_CHECKING:
    import pandas as pd

_DISTRIBUTIONS = {
    "length": "frames of a sequence",
    "box_size": "size of the box, square root of its area (pixels)",
    "step": "step of the centre (pixels)",
    "relative_step": "step / size of the box",
    "mean_grey": "mean grey level of a frame (0-1)",
    "light_spread": "spread of light over the frame (stops)",
    "light_spread_around_target": "spread of light around the target (stops)",
}
_COLUMNS = ("mean", "min", "p5", "p25", "p50", "p75", "p95", "max")


def statistics_markdown(
    name: str,
    summary: Mapping[str, Any],
    sequences: "pd.DataFrame",
    attributes: "pd.DataFrame",
    meanings: Mapping[str, str],
) -> str:
    """One page that describes a dataset.

    Args:
        name: of the dataset.
        summary: of `DatasetStatistics.summary()`.
        sequences: one row a sequence.
        attributes: columns `attribute, provenance, sequences`.
        meanings: what each computed attribute means.
    """
    totals = [
        [key.replace("_", " "), _text(summary[key])]
        for key in ("sequences", "frames", "valid_boxes", "absent_frames")
    ]
    totals += [[f"sequences of {size}", str(n)] for size, n in summary["frame_sizes"].items()]
    spreads = [
        [words, *(_text(summary[key][column]) for column in _COLUMNS)]
        for key, words in _DISTRIBUTIONS.items()
        if key in summary
    ]
    labels = [
        [name, provenance, str(count), meanings.get(name, "") if provenance == "computed" else ""]
        for name, provenance, count in attributes.to_numpy(object).tolist()
    ]
    shown = [c for c in sequences.columns if c == "sequence" or not _is_empty(sequences[c])]
    rows = [list(map(_text, row)) for row in sequences[shown].to_numpy(object)]
    parts = [
        f"# {name}",
        _table(["total", ""], totals),
        "## Distributions",
        _table(["", *_COLUMNS], spreads),
        "## Attributes",
        _table(["attribute", "provenance", "sequences", "computed as"], labels),
        "## Sequences",
        _table([c.replace("_", " ") for c in shown], rows),
    ]
    return "\n\n".join(parts) + "\n"


def _is_empty(column: "pd.Series[Any]") -> bool:
    return bool(column.isna().all() or (column.astype(str) == "").all())


def _text(value: Any) -> str:
    if isinstance(value, float):
        return "" if value != value else f"{value:.4g}" if abs(value) < 1e4 else f"{value:.0f}"
    return str(value).replace("|", "\\|")


def _table(headings: Iterable[str], rows: Iterable[Sequence[str]]) -> str:
    head = list(headings)
    return pipe_table(head, rows, words=len(head)).rstrip("\n")
