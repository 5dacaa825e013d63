"""The numbers that a paper about a dataset gives: lengths, sizes, motion, places, light, labels."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from nat2024.analysis.attributes import (
    ComputedAttributes,
    computed_attributes,
    published_attributes,
)
from nat2024.analysis.boxes import trace_boxes
from nat2024.analysis.rules import RULES, AttributeRules
from nat2024.errors import FrameUnreadable
from nat2024.types import Dataset, Floats, Sequence

if TYPE_CHECKING:
    import pandas as pd

HEAT_MAP_CELLS = (32, 18)
"""(columns, rows) of the centre heat map."""

_PERCENTILES = (5, 25, 50, 75, 95)
_LIGHT_COLUMNS = (
    "mean_grey",
    "grey_around_target",
    "light_spread",
    "light_spread_around_target",
    "saturated_beside_dark",
)


@dataclass(frozen=True, slots=True)
class DatasetStatistics:
    """Statistics of a dataset; tables are pandas DataFrames.

    Attributes:
        name: of the dataset.
        rules: by which attributes were computed.
        every: distance of the frames whose pixels were looked at, 0 for none.
        sequences: one row a sequence; see `SEQUENCE_COLUMNS`.
        boxes: one row a valid box: `sequence, frame, size, step, relative_step, x, y`; size is
            the square root of the area, steps are from the frame before, x and y the centre
            over the width and height of the frame.
        light: one row a frame whose pixels were looked at: `sequence, frame, mean, spread,
            target, around, target_spread, saturated_beside_dark`; as in `LightTrace`.
        heat_map: float64 (18, 32), share of the centres by cell of the frame; every sequence
            counts the same, centres outside the frame count nowhere.
        attributes: one row an attribute and provenance: `attribute, provenance, sequences`.
        co_occurrence: sequences that carry both of two attributes; index and columns are
            `attribute (provenance)`.
    """

    name: str
    rules: AttributeRules
    every: int
    sequences: "pd.DataFrame"
    boxes: "pd.DataFrame"
    light: "pd.DataFrame"
    heat_map: Floats
    attributes: "pd.DataFrame"
    co_occurrence: "pd.DataFrame"

    def summary(self) -> dict[str, Any]:
        """Totals and percentiles, as plain numbers by name; what was not measured is left out."""
        table = self.sequences
        found: dict[str, Any] = {
            "sequences": len(table),
            "frames": int(table.frames.sum()),
            "valid_boxes": len(self.boxes),
            "absent_frames": int(table.absent_frames.sum()),
            "frame_sizes": _counts(table),
            "length": _distribution(table.frames),
            "box_size": _distribution(self.boxes["size"]),
            "step": _distribution(self.boxes.step),
            "relative_step": _distribution(self.boxes.relative_step),
            "mean_grey": _distribution(self.light["mean"]),
            "light_spread": _distribution(self.light.spread),
            "light_spread_around_target": _distribution(self.light.target_spread),
        }
        return {key: value for key, value in found.items() if value != {}}


SEQUENCE_COLUMNS = (
    "sequence",
    "frames",
    "width",
    "height",
    "valid_boxes",
    "absent_frames",
    "first_area",
    "smallest_size",
    "median_size",
    "largest_size",
    "scale_change",
    "aspect_change",
    "median_step",
    "largest_step",
    "median_relative_step",
    *_LIGHT_COLUMNS,
    "published",
    "computed",
)
"""Columns of `DatasetStatistics.sequences`: sizes are square roots of areas in pixels, changes are
factors to the first box, light is the mean over the frames looked at; the last two name the
attributes of each provenance."""


def dataset_statistics(
    dataset: Dataset,
    *,
    rules: AttributeRules = RULES["uav123"],
    every: int = 1,
    on_frame: Callable[[], object] | None = None,
    on_failure: Callable[[str, FrameUnreadable], object] | None = None,
) -> DatasetStatistics:
    """Describe a loaded dataset.

    Args:
        dataset: sequences without annotation, or with boxes on some frames, count as far as they
            go.
        rules: thresholds of computed attributes.
        every: look at the pixels of every `every`-th frame, 0 of none.
        on_frame: called after each decoded frame, to show progress.
        on_failure: called with name and reason of a sequence that cannot be read, which is then
            left out; without it the reason is raised.

    Raises:
        FrameUnreadable: a frame cannot be decoded.
    """
    import pandas as pd

    rows, boxes, light = [], [], []
    heat_map = np.zeros(HEAT_MAP_CELLS[::-1])
    carried: dict[str, set[tuple[str, str]]] = {}
    for sequence in dataset:
        try:
            found = computed_attributes(
                sequence, rules=rules, pixels=every > 0, every=max(every, 1), on_frame=on_frame
            )
            places = _box_rows(sequence)
            rows.append(_sequence_row(sequence, found, places))
        except FrameUnreadable as error:
            if on_failure is None:
                raise
            on_failure(sequence.name, error)
            continue
        boxes.append(places)
        light.append(_light_rows(found))
        heat_map += _heat_map(places)
        carried[sequence.name] = _labels(sequence, found)
    labels = _label_order(dataset, rules, pixels=every > 0)
    counted = heat_map.sum()
    return DatasetStatistics(
        dataset.name,
        rules,
        every,
        pd.DataFrame(rows, columns=list(SEQUENCE_COLUMNS)),
        _concat(boxes, ["sequence", "frame", "size", "step", "relative_step", "x", "y"]),
        _concat(light, ["sequence", "frame", *_TRACE_COLUMNS]),
        heat_map / counted if counted else heat_map,
        _attribute_table(labels, carried),
        _co_occurrence(labels, carried),
    )


_TRACE_COLUMNS = ("mean", "spread", "target", "around", "target_spread", "saturated_beside_dark")


def _box_rows(sequence: Sequence) -> "pd.DataFrame":
    import pandas as pd

    trace = trace_boxes(sequence)
    kept = np.flatnonzero(trace.valid)
    centres = trace.centres[kept] / np.array(sequence.frame_size)
    return pd.DataFrame(
        {
            "sequence": sequence.name,
            "frame": kept,
            "size": trace.sizes[kept],
            "step": trace.steps[kept],
            "relative_step": trace.relative_steps[kept],
            "x": centres[:, 0],
            "y": centres[:, 1],
        }
    )


def _sequence_row(
    sequence: Sequence, found: ComputedAttributes, places: "pd.DataFrame"
) -> dict[str, Any]:
    size, step = places["size"], places.step
    width, height = sequence.frame_size
    measured = found.measured
    return {
        "sequence": sequence.name,
        "frames": len(sequence),
        "width": width,
        "height": height,
        "valid_boxes": len(places),
        "absent_frames": int(measured.get("absent_frames", 0)),
        "first_area": size.iloc[0] ** 2 if len(size) else np.nan,
        "smallest_size": size.min(),
        "median_size": size.median(),
        "largest_size": size.max(),
        "scale_change": measured.get("scale_change", np.nan),
        "aspect_change": measured.get("aspect_change", np.nan),
        "median_step": step.median(),
        "largest_step": step.max(),
        "median_relative_step": places.relative_step.median(),
        **{name: measured.get(name, np.nan) for name in _LIGHT_COLUMNS},
        "published": " ".join(sorted(published_attributes(sequence))),
        "computed": " ".join(name for name, has in found.labels.items() if has),
    }


def _light_rows(found: ComputedAttributes) -> "pd.DataFrame":
    import pandas as pd

    light = found.light
    if light is None:
        return pd.DataFrame()
    columns = {name: getattr(light, name) for name in _TRACE_COLUMNS}
    return pd.DataFrame({"sequence": found.sequence, "frame": light.frames, **columns})


def _heat_map(places: "pd.DataFrame") -> Floats:
    columns, rows = HEAT_MAP_CELLS
    counts, _, _ = np.histogram2d(
        places.y, places.x, bins=(rows, columns), range=((0.0, 1.0), (0.0, 1.0))
    )
    shares: Floats = counts / max(counts.sum(), 1)
    return shares


def _labels(sequence: Sequence, found: ComputedAttributes) -> set[tuple[str, str]]:
    """Attributes of a sequence with their provenance; recomputed ones are not taken twice."""
    own = {(a, sequence.provenance.get(a, "published")) for a in sequence.attributes}
    return {pair for pair in own if pair[1] != "computed"} | {
        (a, "computed") for a in found.attributes
    }


def _label_order(dataset: Dataset, rules: AttributeRules, *, pixels: bool) -> list[tuple[str, str]]:
    own = {(a, s.provenance.get(a, "published")) for s in dataset for a in s.attributes}
    names = [*dataset.attribute_names, *sorted({a for a, _ in own} - {*dataset.attribute_names})]
    kinds = ("published", "manual")
    first = [(a, kind) for a in names for kind in kinds if (a, kind) in own]
    computed = (*rules.box_attributes, *(rules.pixel_attributes if pixels else ()))
    return first + [(a, "computed") for a in computed]


def _attribute_table(
    labels: list[tuple[str, str]], carried: dict[str, set[tuple[str, str]]]
) -> "pd.DataFrame":
    import pandas as pd

    rows = [(a, kind, sum((a, kind) in own for own in carried.values())) for a, kind in labels]
    return pd.DataFrame(rows, columns=["attribute", "provenance", "sequences"])


def _co_occurrence(
    labels: list[tuple[str, str]], carried: dict[str, set[tuple[str, str]]]
) -> "pd.DataFrame":
    import pandas as pd

    flags = np.array([[label in own for label in labels] for own in carried.values()], dtype=int)
    flags = flags.reshape(len(carried), len(labels))
    names = [f"{a} ({kind})" for a, kind in labels]
    return pd.DataFrame(flags.T @ flags, index=names, columns=names)


def _concat(parts: "list[pd.DataFrame]", columns: list[str]) -> "pd.DataFrame":
    import pandas as pd

    filled = [part for part in parts if len(part)]
    return pd.concat(filled, ignore_index=True) if filled else pd.DataFrame(columns=columns)


def _distribution(values: "pd.Series[Any]") -> dict[str, float]:
    """Number, mean, extremes and percentiles of the finite values; empty without any."""
    numbers = np.asarray(values, dtype=np.float64)
    numbers = numbers[np.isfinite(numbers)]
    if not len(numbers):
        return {}
    shares = zip(_PERCENTILES, np.percentile(numbers, _PERCENTILES), strict=True)
    return {
        "count": len(numbers),
        "mean": float(numbers.mean()),
        "min": float(numbers.min()),
        **{f"p{share}": float(value) for share, value in shares},
        "max": float(numbers.max()),
    }


def _counts(table: "pd.DataFrame") -> dict[str, int]:
    """Number of sequences by frame size, the most frequent first."""
    sizes = [f"{w}x{h}" for w, h in zip(table.width, table.height, strict=True)]
    return {size: sizes.count(size) for size in sorted(set(sizes), key=lambda s: -sizes.count(s))}
