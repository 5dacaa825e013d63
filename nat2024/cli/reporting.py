"""From evaluations and evidence to the model of the page."""

import dataclasses
import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

from nat2024.cli.display_names import category_name
from nat2024.cli.scoring import Scored
from nat2024.errors import NatBenchError

if TYPE_CHECKING:
    import pandas as pd

    from nat2024.evaluation import Evaluation, RunScores
    from nat2024.evidence import Evidence, SequenceEvidence
    from nat2024.metrics import Protocol
    from nat2024.types import Dataset
    from nat2024_reports.page import (
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

_PLAIN = "none"

_LIGHT = {
    "unevenness": ("Unevenness of light", 2, "Spread of light over the frame in stops, median"),
    "target_unevenness": (
        "Unevenness around the target",
        2,
        "Spread of light around the target in stops, median",
    ),
    "luminance": ("Luminance", 3, "Mean grey level of the frame, 0 to 1, median"),
    "target_luminance": ("Luminance of the target", 3, "Mean grey level in the box, 0 to 1"),
}
_TRACES = {
    "mean": ("Luminance of the frame", "Mean, 0..1"),
    "spread": ("Unevenness of light over the frame", "Stops"),
    "target_spread": ("Unevenness of light around the target", "Stops"),
}
_LOSSES = {
    "first_loss": ("first loss", 0, "Frame in which the first loss begins, from 0"),
    "losses": ("losses", 0, "How often the target is lost"),
    "lost": ("frames lost", 0, "Frames in losses"),
    "recoveries": ("recoveries", 0, "Losses after which the boxes overlap again"),
    "drift": ("drift px/frame", 2, "Growth of the centre error before the first loss"),
    "longest": ("longest", 0, "Frames in the longest span without a loss"),
    "luminance_at_loss": ("luminance", 3, "Mean grey level around the target then, 0 to 1"),
    "unevenness_at_loss": ("uneven light", 2, "Spread of light around the target then, in stops"),
    "over_enhancement_at_loss": (
        "over-enhanced",
        3,
        "How far the enhancer took the bright parts of the search region towards white, 0 to 1",
    ),
}
_PICTURE_ORDER = ("worst", "best", "first loss", "largest gain", "largest harm")


def build_model(
    scored: Iterable[Scored],
    *,
    title: str,
    frames: bool,
    on_length: str | None = None,
    progress: "Callable[[Dataset], Any]",
) -> "Page":
    """The model of the page, all evidence included.

    Args:
        scored: evaluations with their datasets.
        title: heading; empty names the datasets.
        frames: whether frames may be looked at.
        on_length: as for `evaluate`, for the protocols beside the main one.
        progress: makes a context for each dataset whose value is called after each frame.
    """
    from nat2024_reports.page import Page

    parts = [_dataset_part(one, frames, on_length, progress) for one in scored]
    names = ", ".join(part.name for part in parts)
    heading = title or f"Night tracking on {names}"
    return Page(heading, tuple(parts), made_by=f"nat-bench {version('nat-bench')}")


def _dataset_part(
    scored: Scored,
    frames: bool,
    on_length: str | None,
    progress: "Callable[[Dataset], Any]",
) -> "DatasetPart":
    from nat2024_reports.page import DatasetPart

    evaluation, dataset = scored.evaluation, scored.dataset
    evidence = _gathered(scored, frames, progress)
    protocols = [_protocol_scores(evaluation)]
    remarks = [*_about_runs(evaluation), *evaluation.remarks(), *evidence.notes]
    for other in _other_protocols(scored):
        try:
            protocols.append(_protocol_scores(_evaluated(scored, other, on_length)))
        except NatBenchError as error:
            remarks.append(f"not scored under protocol {other.title}: {error}")
    if not frames:
        remarks.append("frames were left out: no light and no pictures")
    return DatasetPart(
        name=dataset.name,
        runs=tuple(_runs(evaluation)),
        protocols=tuple(protocols),
        sequences=tuple(_sequences(dataset, evaluation, evidence)),
        failures=_failures(evidence),
        light_measures=tuple(_light_measures(evidence)),
        remarks=tuple(remarks),
    )


def _gathered(scored: Scored, frames: bool, progress: "Callable[[Dataset], Any]") -> "Evidence":
    """The evidence; none with a note where it cannot be had, since the scores are still there."""
    from nat2024.evidence import Evidence, gather

    evaluation, dataset = scored.evaluation, scored.dataset
    try:
        with progress(dataset) as step:
            return gather(evaluation, dataset, scored.folder, frames=frames, on_frame=step)
    except NatBenchError as error:
        return Evidence(dataset.name, (), (f"no losses, light and pictures: {error}",))


def _about_runs(evaluation: "Evaluation") -> Iterator[str]:
    trackers = {run.tracker for run in evaluation.runs}
    if len(evaluation.runs) == 1:
        yield "one run only: there is nothing to compare it with"
    elif len(trackers) == 1:
        yield f"one tracker only, {trackers.pop()}: what is seen may not hold for others"
    if foreign := [run.run for run in evaluation.runs if run.manifest is None]:
        few = ", ".join(foreign[:5]) + (", ..." if len(foreign) > 5 else "")
        yield f"no manifest tells how these were made: {few}"


def _other_protocols(scored: Scored) -> "Iterator[Protocol]":
    """Every protocol but the main one, in the form that takes this ground truth."""
    import numpy as np

    from nat2024.metrics import Protocol, list_protocols

    has_gaps = any(np.isnan(sequence.boxes).any() for sequence in scored.dataset)
    for name in list_protocols():
        if name == scored.evaluation.protocol.name:
            continue
        # pytracking refuses NaN but under its label of drone video
        label = "uav" if name == "pytracking" and has_gaps else None
        yield Protocol(name, label=label)


def _evaluated(scored: Scored, protocol: "Protocol", on_length: str | None) -> "Evaluation":
    from nat2024.evaluation import evaluate

    names = [run.run for run in scored.evaluation.runs]
    found = evaluate(
        scored.folder,
        scored.dataset,
        protocol=protocol,
        on_length=on_length,
        runs=names,
        cache=scored.cache,
    )
    return dataclasses.replace(
        found,
        attributes=scored.evaluation.attributes,
        provenance=scored.evaluation.provenance,
        categories=scored.evaluation.categories,
    )


def _ordered(evaluation: "Evaluation") -> "list[RunScores]":
    def place(run: "RunScores") -> tuple[str, bool, str, str, str]:
        return run.tracker, run.enhancer != _PLAIN, run.scope, run.enhancer, run.run

    return sorted(evaluation.runs, key=place)


def _runs(evaluation: "Evaluation") -> "Iterator[Run]":
    from nat2024.cli.display_names import display_names
    from nat2024_reports.page import Run

    trackers = display_names((run.tracker for run in evaluation.runs), "tracker")
    enhancers = display_names((run.enhancer for run in evaluation.runs), "enhancer")
    for run in _ordered(evaluation):
        timing = run.manifest.timing if run.manifest else None
        yield Run(
            name=run.run,
            tracker=trackers[run.tracker],
            enhancer=enhancers[run.enhancer],
            scope=run.scope,
            frames_per_second=timing.frames_per_second if timing else math.nan,
        )


def _protocol_scores(evaluation: "Evaluation") -> "ProtocolScores":
    from nat2024_reports.page import ProtocolScores

    return ProtocolScores(
        title=evaluation.protocol.title,
        description=evaluation.protocol.description,
        subsets=tuple(_subsets(evaluation)),
        per_sequence=_by_sequence(evaluation),
    )


def _by_sequence(evaluation: "Evaluation") -> "pd.DataFrame":
    """As `Evaluation.per_sequence`, without averaging each sequence alone, which takes seconds."""
    import pandas as pd

    from nat2024.evaluation import SCORES

    rows = [
        (run.run, name, *(getattr(scores, score) for score in SCORES))
        for run in evaluation.runs
        for name, scores in run.sequences.items()
    ]
    return pd.DataFrame(rows, columns=["run", "sequence", *SCORES])


def _subsets(evaluation: "Evaluation") -> "Iterator[Subset]":
    from nat2024.datasets.terms import attribute_term

    every = tuple(dict.fromkeys(name for run in evaluation.runs for name in run.sequences))
    yield _subset(evaluation, "all", "", every)
    for attribute, names in evaluation.attributes.items():
        sources = {evaluation.provenance.get(n, {}).get(attribute, "published") for n in names}
        provenance = sources.pop() if len(sources) == 1 else "mixed"
        found = _subset(evaluation, "attribute", attribute, names, provenance)
        if found is not None:
            yield dataclasses.replace(found, meaning=attribute_term(attribute).title)
    for category, names in evaluation.categories.items():
        found = _subset(evaluation, "category", category_name(category), names)
        if found is not None:
            yield found


def _subset(
    evaluation: "Evaluation",
    kind: Any,
    name: str,
    sequences: tuple[str, ...],
    provenance: str = "published",
) -> "Any":
    """The scores over some sequences; None where no run has any of them."""
    from nat2024_reports.page import Subset

    wanted = frozenset(sequences)
    runs = [
        dataclasses.replace(run, sequences=chosen)
        for run in evaluation.runs
        if (chosen := {n: scores for n, scores in run.sequences.items() if n in wanted})
    ]
    if not runs:
        return None
    part = dataclasses.replace(evaluation, runs=tuple(runs))
    return Subset(
        kind=kind,
        name=name,
        provenance=provenance,
        sequences=sequences,
        summary=part.summary(),
        curves=part.curves(),
        gains=part.gains(),
    )


def _sequences(
    dataset: "Dataset", evaluation: "Evaluation", evidence: "Evidence"
) -> "Iterator[SequencePart]":
    from nat2024_reports.page import SequencePart

    scored = {name for run in evaluation.runs for name in run.sequences}
    found = {sequence.name: sequence for sequence in evidence.sequences}
    light = evidence.light().set_index("sequence")
    for sequence in dataset:
        if sequence.name not in scored:
            continue
        seen = found.get(sequence.name)
        means: Mapping[str, float] = (
            {key: float(light.loc[sequence.name, key]) for key in _LIGHT}  # type: ignore[arg-type]
            if sequence.name in light.index
            else {}
        )
        yield SequencePart(
            name=sequence.name,
            frames=seen.length if seen else len(sequence),
            category=category_name(sequence.category),
            attributes={
                name: sequence.provenance.get(name, "published") for name in sequence.attributes
            },
            tracks=_tracks(seen) if seen else {},
            light=tuple(_light_curves(seen)) if seen else (),
            light_means=means,
            thumbnails=tuple(_thumbnails(seen)) if seen else (),
        )


def _tracks(sequence: "SequenceEvidence") -> "dict[str, Track]":
    import numpy as np

    from nat2024_reports.page import Track

    found = {}
    for run, track in sequence.tracks.items():
        overlap, error = (np.full(sequence.length, np.nan) for _ in range(2))
        overlap[track.frames], error[track.frames] = track.overlap, track.center_error
        losses = () if track.first_loss is None else (track.first_loss,)
        found[run] = Track(overlap, error, losses)
    return found


def _light_curves(sequence: "SequenceEvidence") -> "Iterator[LightCurve]":
    import numpy as np

    from nat2024_reports.page import LightCurve

    light = sequence.light
    if light is None:
        return
    for name, (title, unit) in _TRACES.items():
        levels = getattr(light, name)
        if np.isfinite(levels).any():
            yield LightCurve(title, unit, light.frames, levels)


def _thumbnails(sequence: "SequenceEvidence") -> "Iterator[Thumbnail]":
    from nat2024_reports.page import Thumbnail

    def place(reasons: tuple[str, ...]) -> int:
        known = [_PICTURE_ORDER.index(one) for one in reasons if one in _PICTURE_ORDER]
        return min(known, default=len(_PICTURE_ORDER))

    for one in sorted(sequence.thumbnails, key=lambda one: place(one.reasons)):
        yield Thumbnail(
            frame=one.frame,
            caption=", ".join(one.reasons),
            jpeg=one.jpeg,
            window=(0.0, 0.0, float(one.width), float(one.height)),
            truth=one.truth,
            boxes=one.boxes,
            run=one.run,
        )


def _failures(evidence: "Evidence") -> "FailureTable":
    from nat2024_reports.page import FailureTable

    rows = evidence.failures()
    lost = rows[rows["first_loss"].notna()]
    return FailureTable(tuple(_columns(_LOSSES, lost)), lost.reset_index(drop=True))


def _light_measures(evidence: "Evidence") -> "Iterator[Column]":
    yield from _columns(_LIGHT, evidence.light())


def _columns(known: Mapping[str, tuple[str, int, str]], table: Any) -> "Iterator[Column]":
    """Columns that hold any number."""
    from nat2024_reports.page import Column

    for key, (heading, decimals, hint) in known.items():
        if key in table and table[key].notna().any():
            yield Column(key, heading, decimals, hint)
