"""Attributes computed from boxes and pixels, of whole sequences and of single frames."""

import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from nat2024.analysis.boxes import BoxTrace, trace_boxes
from nat2024.analysis.light import LightTrace, trace_light
from nat2024.analysis.rules import RULES, AttributeRules
from nat2024.errors import FrameUnreadable
from nat2024.types import Dataset, Flags, Floats, Sequence

_log = logging.getLogger("nat2024")

PROVENANCE = "computed"


@dataclass(frozen=True, slots=True)
class ComputedAttributes:
    """What the rules say of one sequence; its provenance is always `computed`.

    Attributes:
        sequence: its name.
        rules: by which it was computed.
        labels: whether the sequence carries each attribute. Those that cannot be told are not in
            it: without boxes none but UL, with boxes on some frames neither FM nor FOC, without
            pixels none of LAI, IV and UL.
        measured: the numbers that decided, NaN where a target is never seen.
        frames: bool (n,) by attribute, for the same attributes: the frames that carry it. False
            in frames that were not looked at.
        light: light in the frames that were looked at, None without pixels.
    """

    sequence: str
    rules: AttributeRules
    labels: Mapping[str, bool]
    measured: Mapping[str, float]
    frames: Mapping[str, Flags]
    light: LightTrace | None = None

    @property
    def attributes(self) -> frozenset[str]:
        """The attributes that the sequence carries."""
        return frozenset(name for name, carried in self.labels.items() if carried)


def computed_attributes(
    sequence: Sequence,
    *,
    rules: AttributeRules = RULES["uav123"],
    pixels: bool = True,
    every: int = 1,
    on_frame: Callable[[], object] | None = None,
) -> ComputedAttributes:
    """Compute the attributes of one sequence.

    FM, LR, SV, ARC, FOC and IV hold where one frame has them; LAI and UL where the mean over
    frames reaches the threshold; a size bin is that of the first valid box.

    Args:
        sequence: its published attributes are not looked at.
        rules: thresholds; see `AttributeRules`.
        pixels: whether to decode frames, for LAI, IV and UL.
        every: decode every `every`-th frame only.
        on_frame: called after each decoded frame, to show progress.

    Raises:
        FrameUnreadable: a frame cannot be decoded.
        UsageError: `every` is below 1.
    """
    trace = trace_boxes(sequence)
    frames: dict[str, Flags] = {}
    labels: dict[str, bool] = {}
    measured: dict[str, float] = {}
    if len(sequence.boxes):
        frames, measured = _from_boxes(trace, rules, keyframed=sequence.keyframes is not None)
        labels = {name: bool(flags.any()) for name, flags in frames.items()}
        labels.update(_size_bin(trace, rules))
    light = None
    if pixels:
        light = trace_light(
            sequence, every=every, context=rules.low_light_context, on_frame=on_frame
        )
        seen, numbers = _from_light(light, rules)
        measured.update(numbers)
        for name, flags in seen.items():
            frames[name] = np.zeros(len(sequence), dtype=bool)
            frames[name][light.frames] = flags
        labels.update(_light_labels(numbers, seen, rules))
    order = (*rules.box_attributes, *rules.pixel_attributes)
    return ComputedAttributes(
        sequence.name,
        rules,
        {name: labels[name] for name in order if name in labels},
        measured,
        {name: frames[name] for name in order if name in labels},
        light,
    )


def _from_boxes(
    trace: BoxTrace, rules: AttributeRules, *, keyframed: bool
) -> tuple[dict[str, Flags], dict[str, float]]:
    scale, aspect = trace.changes(trace.areas), trace.changes(trace.aspects)
    steps = trace.relative_steps if rules.fast_step_relative else trace.steps
    smallest, middle, largest = rules.size_bins
    small, large = trace.areas < rules.small_area, trace.areas > rules.large_area
    frames = {
        "FM": steps > rules.fast_step,
        "LR": trace.areas < rules.low_area,
        "SV": scale > rules.scale_change,
        "ARC": aspect > rules.aspect_change,
        "FOC": trace.absent,
        smallest: small,
        middle: trace.valid & ~small & ~large,
        largest: large,
    }
    measured = {
        "largest_step": _largest(steps),
        "smallest_area": -_largest(-trace.areas),
        "scale_change": _largest(scale),
        "aspect_change": _largest(aspect),
        "absent_frames": float(trace.absent.sum()),
    }
    if keyframed:  # what is between two annotated frames is not known
        for name in ("FM", "FOC"):
            del frames[name]
        for name in ("largest_step", "absent_frames"):
            del measured[name]
    return frames, measured


def _size_bin(trace: BoxTrace, rules: AttributeRules) -> dict[str, bool]:
    area = trace.areas[int(np.argmax(trace.valid))] if trace.valid.any() else np.nan
    inside = (
        area < rules.small_area,
        rules.small_area <= area <= rules.large_area,
        area > rules.large_area,
    )
    return {name: bool(found) for name, found in zip(rules.size_bins, inside, strict=True)}


def _from_light(
    light: LightTrace, rules: AttributeRules
) -> tuple[dict[str, Flags], dict[str, float]]:
    shifted = light.target + rules.light_floor
    dimmest, brightest = -_largest(-shifted), _largest(shifted)
    factor = np.maximum(brightest / shifted, shifted / dimmest)
    change = _recent_change(light, rules.light_window)
    frames = {
        "LAI": light.around < rules.low_light,
        "IV": (factor > rules.light_ratio) | (change > rules.light_change),
        "UL": light.spread >= rules.uneven_light,
    }
    measured = {
        "grey_around_target": _mean(light.around),
        "light_ratio": brightest / dimmest,
        "light_change": _largest(change),
        "light_spread": _mean(light.spread),
        "light_spread_around_target": _mean(light.target_spread),
        "saturated_beside_dark": _mean(light.saturated_beside_dark),
        "mean_grey": _mean(light.mean),
    }
    return frames, measured


def _light_labels(
    numbers: Mapping[str, float], seen: Mapping[str, Flags], rules: AttributeRules
) -> dict[str, bool]:
    labels = {"UL": numbers["light_spread"] >= rules.uneven_light}
    if not np.isnan(numbers["grey_around_target"]):
        labels["LAI"] = numbers["grey_around_target"] < rules.low_light
        labels["IV"] = bool(seen["IV"].any())
    return labels


def _recent_change(light: LightTrace, window: int) -> Floats:
    """Largest change of the grey level of the box from a frame at most `window` frames before."""
    found = np.full(len(light.frames), np.nan)
    start = 0
    for position, frame in enumerate(light.frames):
        while light.frames[start] < frame - window:
            start += 1
        found[position] = _largest(np.abs(light.target[start:position] - light.target[position]))
    return found


def _largest(values: Floats) -> float:
    kept = values[np.isfinite(values)]
    return float(kept.max()) if len(kept) else float("nan")


def _mean(values: Floats) -> float:
    kept = values[np.isfinite(values)]
    return float(kept.mean()) if len(kept) else float("nan")


def published_attributes(sequence: Sequence) -> frozenset[str]:
    """The attributes of a sequence that its publisher gave it."""
    origin = sequence.provenance
    return frozenset(a for a in sequence.attributes if origin.get(a, "published") == "published")


def published_names(dataset: Dataset) -> tuple[str, ...]:
    """The attributes that are published for a dataset, also those that no sequence carries.

    An attribute that sequences carry by another provenance alone is not among them.
    """
    published = {name for s in dataset for name in published_attributes(s)}
    carried = {name for s in dataset for name in s.attributes}
    listed = [n for n in dataset.attribute_names if n in published or n not in carried]
    return (*listed, *sorted(published - {*listed}))


def with_computed_attributes(
    dataset: Dataset,
    *,
    rules: AttributeRules = RULES["uav123"],
    pixels: bool = True,
    every: int = 1,
    on_frame: Callable[[], object] | None = None,
) -> Dataset:
    """The same dataset whose sequences carry computed attributes beside published ones.

    An attribute that is published for the dataset stays as published, everywhere: published and
    computed labels of one name are never mixed. `Sequence.provenance` tells them apart.

    Args:
        dataset: loaded; nothing of it is modified.
        rules: as in `computed_attributes`, like the rest.
        pixels: whether to decode frames, for LAI, IV and UL.
        every: decode every `every`-th frame only.
        on_frame: called after each decoded frame.

    A sequence with a frame that cannot be decoded gets what boxes alone tell, and a line of log.
    """
    published = set(published_names(dataset))
    sequences = []
    for sequence in dataset:
        try:
            found = computed_attributes(
                sequence, rules=rules, pixels=pixels, every=every, on_frame=on_frame
            )
        except FrameUnreadable as error:
            _log.warning("%s: attributes from boxes alone: %s", sequence.name, error)
            found = computed_attributes(sequence, rules=rules, pixels=False)
        added = found.attributes - published - sequence.attributes
        provenance = {**sequence.provenance, **dict.fromkeys(sorted(added), PROVENANCE)}
        sequences.append(
            replace(sequence, attributes=sequence.attributes | added, provenance=provenance)
        )
    names = (*rules.box_attributes, *(rules.pixel_attributes if pixels else ()))
    first = dataset.attribute_names or tuple(sorted(published))
    return replace(
        dataset,
        sequences=tuple(sequences),
        attribute_names=(*first, *(name for name in names if name not in first)),
    )
