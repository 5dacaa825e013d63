"""What is shown of one sequence: runs, their boxes and looks, frames, enhancers."""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from nat2024.analysis import Moment
from nat2024.analysis.moments import PRIORITY
from nat2024.errors import FrameUnreadable, NatBenchError
from nat2024.evaluation import Evaluation
from nat2024.evaluation.gains import paired_runs
from nat2024.evidence import SequenceEvidence, gather, make_again, telling_frames
from nat2024.types import Dataset, Image, Sequence

if TYPE_CHECKING:
    from pathlib import Path

    from nat2024.interfaces import Enhancer
    from nat2024.store import PluginRecord
    from nat2024_reports.figures.looks import Look, NamedRun

MOST_RUNS = 6
"""More boxes than these cannot be told apart in a picture; where no run is named, no more are
drawn."""

ORIGINAL = "original"


@dataclass(slots=True)
class Shown:
    """One sequence with the runs that are drawn into it.

    Attributes:
        sequence: whose frames.
        evidence: boxes, overlaps and losses of the runs that are drawn.
        looks: by run, in their order.
        moments: frames that tell most about these runs, in the order of frames.
        enhancers: enhanced images beside the original, by display name.
        remarks: what could not be had, each once.
    """

    sequence: Sequence
    evidence: SequenceEvidence
    looks: "Mapping[str, Look]"
    moments: list[tuple[int, Moment]]
    enhancers: "Mapping[str, Enhancer]" = field(default_factory=dict)
    remarks: list[str] = field(default_factory=list)

    def images(self, frame: int) -> dict[str, Image | None]:
        """The frame, then the enhanced ones; None where it cannot be read."""
        try:
            image: Image | None = self.sequence.image(frame)
        except FrameUnreadable as error:
            image = None
            self.remark(str(error))
        found: dict[str, Image | None] = {ORIGINAL: image}
        for name, enhancer in self.enhancers.items():
            found[name] = None
            if image is None:
                continue
            try:
                found[name] = enhancer.enhance(image, bgr=True)
            except NatBenchError as error:
                self.remark(f"{name}: {error}")
        return found

    def remark(self, line: str) -> None:
        """Keep a remark once."""
        if line not in self.remarks:
            self.remarks.append(line)


def telling_sequences(evaluation: Evaluation, runs: Collection[str], count: int) -> list[str]:
    """Sequences on which an enhancer changes success most, else the worst ones."""
    scores: dict[str, float] = {}
    for run, base in paired_runs(evaluation):
        if run.run in runs and base.run in runs:
            for name in run.sequences.keys() & base.sequences.keys():
                change = _success(run.sequences[name]) - _success(base.sequences[name])
                scores[name] = max(scores.get(name, 0.0), abs(np.nan_to_num(change)))
    if not scores:
        for one in evaluation.runs:
            for name, found in one.sequences.items() if one.run in runs else ():
                missed = 1 - np.nan_to_num(_success(found))
                scores[name] = max(scores.get(name, 0.0), missed)
    return sorted(scores, key=lambda name: (-scores[name], name))[:count]


def _success(scores: object) -> float:
    value = float(getattr(scores, "success_auc", np.nan))
    return float(getattr(scores, "average_overlap", np.nan)) if np.isnan(value) else value


def telling_runs(evaluation: Evaluation, runs: Collection[str], sequence: str) -> list[str]:
    """At most `MOST_RUNS` runs of a sequence: the enhancer that changes most, over three trackers.

    All of them where there are no more than that.
    """
    there = [r.run for r in evaluation.runs if r.run in runs and sequence in r.sequences]
    if len(there) <= MOST_RUNS:
        return there
    changes: dict[str, list[tuple[float, str, str]]] = {}
    for run, base in paired_runs(evaluation):
        if run.run in there and base.run in there:
            change = _success(run.sequences[sequence]) - _success(base.sequences[sequence])
            size = float(abs(np.nan_to_num(change)))
            changes.setdefault(run.enhancer, []).append((size, run.run, base.run))
    if not changes:
        return there[:MOST_RUNS]
    best = max(changes.values(), key=lambda found: sum(sorted(size for size, _, _ in found)[-3:]))
    best.sort(key=lambda one: (-one[0], one[1]))
    chosen = {name for _, *pair in best[: MOST_RUNS // 2] for name in pair}
    return [run for run in there if run in chosen]


def looks_of_runs(runs: "Iterable[NamedRun]", every: "Iterable[NamedRun]") -> "dict[str, Look]":
    """One colour a tracker where that tells all; else one a run, dashed without an enhancer.

    Colours are those of the other figures, unless two that are shown together would have the same.
    """
    from dataclasses import replace

    from nat2024_reports.figures.looks import looks_of
    from nat2024_reports.style import COLOURS

    runs = list(runs)
    enhancers = {run.enhancer for run in runs if not run.is_plain}
    trackers = {run.tracker for run in runs}
    if len(enhancers) <= 1 or len(trackers) == 1:
        by_tracker = len(enhancers) <= 1
        looks = looks_of(runs, every, by_tracker=by_tracker)
        told = len({look.color for look in looks.values()})
        wanted = len(trackers) if by_tracker else len({run.enhancer for run in runs})
        return looks if told == wanted else looks_of(runs, runs, by_tracker=by_tracker)
    looks = looks_of(runs, every, by_tracker=True)
    return {
        run: replace(look, color=COLOURS[number % len(COLOURS)])
        for number, (run, look) in enumerate(looks.items())
    }


def look_into(
    evaluation: Evaluation, dataset: Dataset, results: "Path", sequence: str
) -> SequenceEvidence:
    """Boxes and losses of the runs of an evaluation on one sequence; looks at no frame."""
    one = dataset.select([sequence])
    return gather(evaluation, one, results, frames=False).sequences[0]


def moments_of(evaluation: Evaluation, found: SequenceEvidence) -> list[tuple[int, Moment]]:
    """The telling frames of a sequence and why they tell."""
    pairs = [(run.run, base.run) for run, base in paired_runs(evaluation)]
    return telling_frames(found.tracks, pairs)


def choose_frames(
    moments: Iterable[tuple[int, Moment]], scored: Collection[int], count: int
) -> list[tuple[int, str, str]]:
    """Frames of a strip with the reason and run of each: moments first, then evenly spread ones.

    Args:
        moments: as `moments_of` gives them.
        scored: numbers of the frames to choose from.
        count: how many.
    """
    ranked = sorted(moments, key=lambda one: min(PRIORITY.index(r) for r in one[1].reasons))
    chosen = {frame: (", ".join(m.reasons), m.run) for frame, m in ranked[:count]}
    numbers = sorted(scored)
    while len(chosen) < min(count, len(numbers)):
        taken = np.array(sorted(chosen)) if chosen else np.array([-len(numbers)])
        rest = np.array([number for number in numbers if number not in chosen])
        gaps = np.abs(rest[:, None] - taken[None, :]).min(axis=1)
        chosen[int(rest[int(gaps.argmax())])] = ("", "")
    return [(frame, *chosen[frame]) for frame in sorted(chosen)]


def enhancers_of(
    records: "Mapping[str, PluginRecord]", device: str
) -> "tuple[dict[str, Enhancer], list[str]]":
    """Enhancers made again by display name, and a line for each that cannot be."""
    made: dict[str, Enhancer] = {}
    problems = []
    for name, record in records.items():
        try:
            made[name] = make_again(record, device)
        except NatBenchError as error:
            problems.append(f"no images by {name}: {error}")
    return made, problems
