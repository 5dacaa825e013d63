"""From the model to what the page's script reads: plain JSON values, arrays as short texts."""

import base64
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from nat2024_reports.page import arrays
from nat2024_reports.page.model import (
    Column,
    DatasetPart,
    FailureTable,
    LightCurve,
    Page,
    ProtocolScores,
    SequencePart,
    Subset,
    Thumbnail,
    Track,
)
from nat2024_reports.page.styles import run_styles

if TYPE_CHECKING:
    import pandas as pd

METRICS: Mapping[str, tuple[str, str]] = {
    "success_auc": ("Success", "Area under the success curve"),
    "precision_20": ("Precision", "Share of frames with a centre error of at most 20 px"),
    "normalized_precision_20": (
        "Norm. precision",
        "Share of frames with a normalized centre error of at most 0.20",
    ),
    "normalized_precision_auc": (
        "Norm. precision AUC",
        "Area under the normalized precision curve",
    ),
    "average_overlap": ("Average overlap", "Mean overlap over the frames with a target"),
    "success_rate_50": ("SR 0.50", "Share of frames with an overlap above 0.50"),
    "success_rate_75": ("SR 0.75", "Share of frames with an overlap above 0.75"),
    "precision_auc": ("Precision AUC", "Area under the precision curve"),
}
"""Scores in the order of the tables: heading and meaning."""

CURVES = ("success", "precision", "normalized_precision")
"""Curves in the order of the page."""

_LONGEST = 1000
_SHORTEST = 120
_SERIES_BYTES = 6_000_000
"""Bytes that the series over time may take; with more series each has fewer points."""

_PICTURE_BYTES = 7_000_000
"""Bytes that pictures may take; what is beyond is left out, and the page says so."""

_GAINS = (
    "base_value", "difference", "difference_low", "difference_high",
    "gain", "gain_low", "gain_high", "improved",
)  # fmt: skip


def page_payload(page: Page) -> tuple[dict[str, Any], dict[str, dict[str, Any]]]:
    """What is read at once, and what is read when a sequence is opened, by key."""
    points = series_points(page)
    kept = _chosen_pictures(page)
    details: dict[str, dict[str, Any]] = {}
    datasets = []
    for number, dataset in enumerate(page.datasets):
        numbers = {run.name: place for place, run in enumerate(dataset.runs)}
        for place, sequence in enumerate(dataset.sequences):
            pictures = [p for p in sequence.thumbnails if id(p) in kept]
            details[f"{number}-{place}"] = _detail(sequence, numbers, points, pictures)
        datasets.append(_dataset(dataset, numbers))
    remarks = list(page.remarks)
    left_out = sum(len(s.thumbnails) for d in page.datasets for s in d.sequences) - len(kept)
    if left_out:
        remarks.append(f"{left_out} pictures are left out to keep this file small")
    metrics = [{"key": k, "title": t, "hint": h} for k, (t, h) in METRICS.items()]
    first = {
        "title": page.title,
        "remarks": remarks,
        "metrics": metrics,
        "steps": {
            "overlap": arrays.OVERLAP_STEPS,
            "error": 1 / arrays.ERROR_STEP,
            "share": arrays.SHARE_STEPS,
        },
        "datasets": datasets,
    }
    return first, details


def series_points(page: Page) -> int:
    """Points of the longest series, so that all series together stay small."""
    series = sum(len(s.tracks) for d in page.datasets for s in d.sequences)
    if not series:
        return _LONGEST
    return max(_SHORTEST, min(_LONGEST, _SERIES_BYTES // (4 * series)))


def _chosen_pictures(page: Page) -> set[int]:
    """Which pictures fit (their `id`s): the first of every sequence before the second of any."""
    queues = [sequence.thumbnails for dataset in page.datasets for sequence in dataset.sequences]
    room, kept = _PICTURE_BYTES, set()
    for rank in range(max((len(queue) for queue in queues), default=0)):
        for queue in queues:
            if rank < len(queue):
                size = len(queue[rank].jpeg) * 4 // 3
                if size <= room:
                    kept.add(id(queue[rank]))
                    room -= size
    return kept


def _dataset(dataset: DatasetPart, numbers: Mapping[str, int]) -> dict[str, Any]:
    places = {sequence.name: place for place, sequence in enumerate(dataset.sequences)}
    bases = _bases(dataset.protocols[0].subsets[0].gains)
    runs = [
        {
            "name": run.name,
            "tracker": run.tracker,
            "enhancer": run.enhancer,
            "scope": run.scope,
            "speed": plain(run.frames_per_second),
            "color": style.color,
            "dash": style.dash,
            "base": numbers.get(bases.get(run.name, "")),
        }
        for run, style in zip(dataset.runs, run_styles(dataset.runs), strict=True)
    ]
    subsets = [
        {
            "kind": subset.kind,
            "name": subset.name,
            "provenance": subset.provenance,
            "meaning": subset.meaning,
            "sequences": [places[name] for name in subset.sequences if name in places],
        }
        for subset in dataset.protocols[0].subsets
    ]
    return {
        "name": dataset.name,
        "runs": runs,
        "subsets": subsets,
        "protocols": [_protocol(p, numbers, places) for p in dataset.protocols],
        "sequences": [_sequence(sequence) for sequence in dataset.sequences],
        "light": [_column(column) for column in dataset.light_measures],
        "failures": _failures(dataset.failures, numbers, places),
        "remarks": list(dataset.remarks),
    }


def _bases(table: "pd.DataFrame | None") -> dict[str, str]:
    """The run of the tracker alone, by the run that is compared with it."""
    if table is None:
        return {}
    return dict(zip(table["run"], table["base"], strict=True))


def _column(column: Column) -> dict[str, Any]:
    return {
        "key": column.key,
        "title": column.heading,
        "decimals": column.decimals,
        "hint": column.hint,
    }


def _protocol(
    scores: ProtocolScores, numbers: Mapping[str, int], places: Mapping[str, int]
) -> dict[str, Any]:
    table = scores.per_sequence
    table = table[table["run"].isin(list(numbers)) & table["sequence"].isin(list(places))]
    rows = [numbers[run] for run in table["run"]]
    columns = [places[sequence] for sequence in table["sequence"]]
    by_sequence = {}
    for name in _defined(table):
        grid: list[list[float | None]] = [[None] * len(places) for _ in numbers]
        for row, column, value in zip(rows, columns, table[name], strict=True):
            grid[row][column] = plain(value)
        by_sequence[name] = grid
    return {
        "title": scores.title,
        "description": scores.description,
        "metrics": _defined(scores.subsets[0].summary),
        "subsets": [_subset(subset, numbers) for subset in scores.subsets],
        "bySequence": by_sequence,
    }


def _defined(table: "pd.DataFrame") -> list[str]:
    return [name for name in METRICS if name in table and table[name].notna().any()]


def _subset(subset: Subset, numbers: Mapping[str, int]) -> dict[str, Any]:
    summary = subset.summary
    rows: list[dict[str, Any] | None] = [None] * len(numbers)
    names = _defined(summary)
    for record in summary.to_dict(orient="records"):
        rows[numbers[record["run"]]] = {
            "sequences": int(record["sequences"]),
            "frames": int(record["frames"]),
            **{name: plain(record[name]) for name in names},
        }
    return {
        "rows": rows,
        "curves": _curves(subset.curves, numbers),
        "gains": _gains(subset.gains, numbers),
    }


def _curves(table: "pd.DataFrame", numbers: Mapping[str, int]) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for metric in CURVES:
        chosen = table[table["metric"] == metric]
        curves: list[str | None] = [None] * len(numbers)
        for run, group in chosen.groupby("run", sort=False):
            if group["value"].notna().any():
                curves[numbers[str(run)]] = arrays.encode(arrays.share_words(group["value"]))
        if any(curves):
            thresholds = chosen[chosen["run"] == chosen["run"].iloc[0]]["threshold"]
            span = [plain(thresholds.iloc[0]), plain(thresholds.iloc[-1])]
            found[metric] = {"from": span[0], "to": span[1], "runs": curves}
    return found


def _gains(
    table: "pd.DataFrame | None", numbers: Mapping[str, int]
) -> dict[str, list[dict[str, Any]]]:
    found: dict[str, list[dict[str, Any]]] = {}
    for record in [] if table is None else table.to_dict(orient="records"):
        row = {name: plain(record[name]) for name in _GAINS}
        row |= {
            "run": numbers[record["run"]],
            "sequences": int(record["sequences"]),
            "certain": bool(record["certain"]),
        }
        found.setdefault(str(record["metric"]), []).append(row)
    return found


def _sequence(sequence: SequencePart) -> dict[str, Any]:
    return {
        "name": sequence.name,
        "frames": sequence.frames,
        "category": sequence.category,
        "attributes": sorted(sequence.attributes.items()),
        "light": {key: plain(value, 4) for key, value in sequence.light_means.items()},
    }


def _failures(
    table: FailureTable | None, numbers: Mapping[str, int], places: Mapping[str, int]
) -> dict[str, Any] | None:
    if table is None:
        return None
    columns = [_column(column) for column in table.columns]
    rows = [
        {
            "run": numbers[record["run"]],
            "sequence": places[record["sequence"]],
            **{c.key: plain(record[c.key]) for c in table.columns},
        }
        for record in table.rows.to_dict(orient="records")
        if record["run"] in numbers and record["sequence"] in places
    ]
    return {"columns": columns, "rows": rows}


def _detail(
    sequence: SequencePart,
    numbers: Mapping[str, int],
    points: int,
    pictures: Iterable[Thumbnail],
) -> dict[str, Any]:
    frames = arrays.sample_frames(sequence.frames, points)
    return {
        "frames": frames.tolist() if len(frames) != sequence.frames else None,
        "tracks": {
            numbers[run]: _track(track, sequence.frames, points)
            for run, track in sequence.tracks.items()
            if run in numbers
        },
        "light": [_light(curve) for curve in sequence.light],
        "pictures": [_picture(picture, numbers) for picture in pictures],
    }


def _track(track: Track, frames: int, points: int) -> dict[str, Any]:
    def fitted(values: Any) -> Any:
        return arrays.extremes(_of_length(values, frames), points)

    return {
        "overlap": arrays.encode(arrays.overlap_bytes(fitted(track.overlap))),
        "error": arrays.encode(arrays.error_words(fitted(track.center_error))),
        "losses": list(track.losses),
    }


def _of_length(values: Any, frames: int) -> Any:
    """The series with one value a frame: cut, or followed by NaN."""
    given = np.asarray(values, dtype=np.float64)[:frames]
    return np.concatenate([given, np.full(frames - len(given), np.nan)])


def _light(curve: LightCurve) -> dict[str, Any]:
    return {
        "title": curve.title,
        "unit": curve.unit,
        "frames": [int(frame) for frame in curve.frames],
        "values": [plain(value, 4) for value in curve.levels.tolist()],
    }


def _picture(picture: Thumbnail, numbers: Mapping[str, int]) -> dict[str, Any]:
    return {
        "frame": picture.frame,
        "caption": picture.caption,
        "run": numbers.get(picture.run),
        "source": "data:image/jpeg;base64," + base64.b64encode(picture.jpeg).decode(),
        "window": [plain(value, 1) for value in picture.window],
        "truth": _box(picture.truth),
        "boxes": {numbers[r]: _box(box) for r, box in picture.boxes.items() if r in numbers},
    }


def _box(box: Sequence[float] | None) -> list[float] | None:
    if box is None or not all(math.isfinite(value) for value in box):
        return None
    return [round(float(value), 1) for value in box]


def plain(value: Any, decimals: int = 6) -> Any:
    """A value that JSON has: numbers rounded, None for what is not finite."""
    if value is None or isinstance(value, str | bool):
        return value
    if hasattr(value, "item"):
        value = value.item()
    if isinstance(value, float):
        return round(value, decimals) if math.isfinite(value) else None
    return value
