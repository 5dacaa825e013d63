"""Computed attributes as plain documents and rows, published ones beside them."""

from collections.abc import Iterator, Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from nat2024.analysis.agreement import label_agreement
from nat2024.analysis.attributes import (
    PROVENANCE,
    ComputedAttributes,
    published_attributes,
    published_names,
)
from nat2024.analysis.rules import attribute_meanings
from nat2024.types import Dataset, Sequence


def attribute_document(
    dataset: Dataset, computed: Mapping[str, ComputedAttributes], *, per_frame: bool = False
) -> dict[str, Any]:
    """All that is known of the attributes of a dataset, ready for JSON.

    Args:
        dataset: as loaded, with its published attributes.
        computed: by name of the sequence, all by the same rules; those not in it are left out.
        per_frame: list the frames that carry each attribute, counted from 0.

    Returns:
        `dataset`, `provenance` ("computed"), `rules` (all thresholds), `meanings`, `sequences`
        (each with `sequence`, `published`, `computed`, `measured`, `frames_looked_at`, and
        `frames` where asked for) and `agreement` of computed with published labels.
    """
    kept = [sequence for sequence in dataset if sequence.name in computed]
    first = next(iter(computed.values()), None)
    return {
        "dataset": dataset.name,
        "provenance": PROVENANCE,
        "rules": asdict(first.rules) if first else {},
        "meanings": attribute_meanings(first.rules) if first else {},
        "sequences": [_entry(dataset, s, computed[s.name], per_frame) for s in kept],
        "agreement": [
            {**asdict(found), "share": found.share} for found in label_agreement(dataset, computed)
        ],
    }


def _entry(
    dataset: Dataset, sequence: Sequence, found: ComputedAttributes, per_frame: bool
) -> dict[str, Any]:
    entry: dict[str, Any] = {
        "sequence": sequence.name,
        "published": _published(dataset, sequence),
        "computed": dict(found.labels),
        "measured": dict(found.measured),
        "frames_looked_at": len(found.light.frames) if found.light else 0,
    }
    if per_frame:
        entry["frames"] = {
            name: np.flatnonzero(flags).tolist() for name, flags in found.frames.items()
        }
    return entry


def _published(dataset: Dataset, sequence: Sequence) -> dict[str, bool]:
    own = published_attributes(sequence)
    return {name: name in own for name in published_names(dataset)}


def attribute_rows(
    dataset: Dataset, computed: Mapping[str, ComputedAttributes]
) -> Iterator[list[str]]:
    """Rows of a table, its headings first: `sequence, provenance` and 0 or 1 by attribute.

    A sequence has a row of each provenance that it has labels of; what is not told stays empty.
    """
    names: dict[str, None] = dict.fromkeys(published_names(dataset))
    names.update(dict.fromkeys(_computed_names(computed)))
    yield ["sequence", "provenance", *names]
    for sequence in dataset:
        if sequence.name not in computed:
            continue
        published = _published(dataset, sequence)
        for provenance, labels in (
            ("published", published),
            (PROVENANCE, computed[sequence.name].labels),
        ):
            if labels:
                yield [sequence.name, provenance, *(_digit(labels.get(name)) for name in names)]


def frame_rows(dataset: Dataset, computed: Mapping[str, ComputedAttributes]) -> Iterator[list[str]]:
    """Rows of a table, its headings first: `sequence, frame, provenance` and 0 or 1 by attribute.

    Frames are counted from 0. What cannot be told of a frame stays empty: it has no annotation,
    or its pixels were not looked at.
    """
    names = _computed_names(computed)
    yield ["sequence", "frame", "provenance", *names]
    for sequence in dataset:
        if sequence.name not in computed:
            continue
        found = computed[sequence.name]
        columns = [_frame_column(sequence, found, name) for name in names]
        for frame, digits in enumerate(zip(*columns, strict=True)):
            yield [sequence.name, str(frame), PROVENANCE, *digits]


def _frame_column(sequence: Sequence, found: ComputedAttributes, name: str) -> list[str]:
    told = np.zeros(len(sequence), dtype=bool)
    if name in found.frames:
        by_pixels = found.light is not None and name in found.rules.pixel_attributes
        keyframes = slice(None) if sequence.keyframes is None else sequence.keyframes
        told[found.light.frames if by_pixels and found.light else keyframes] = True
    flags = found.frames.get(name, told)
    return [_digit(bool(flag) if known else None) for flag, known in zip(flags, told, strict=True)]


def _computed_names(computed: Mapping[str, ComputedAttributes]) -> list[str]:
    """Attributes that were computed of any sequence, in the order of the rules."""
    there = {name for found in computed.values() for name in found.labels}
    rules = [found.rules for found in computed.values()][:1]
    return [
        name for r in rules for name in (*r.box_attributes, *r.pixel_attributes) if name in there
    ]


def _digit(label: bool | None) -> str:
    return "" if label is None else str(int(label))
