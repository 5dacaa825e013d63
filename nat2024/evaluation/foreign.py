"""What is told of a run beside its scores, because nobody knows how it was written."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

from nat2024.importing import FirstRows, compare_first_rows, names_dataset
from nat2024.metrics import Protocol, SequenceScores, summarize
from nat2024.store import Run
from nat2024.types import Box, Dataset, closest

_DEVIATING = ("success_auc", "precision_20", "normalized_precision_20", "average_overlap")
_MOST_NAMES = 5


@dataclass(frozen=True, slots=True)
class ForeignNotes:
    """What was seen while a run without a manifest was read.

    Attributes:
        unreadable: why a sequence was left out, by its name.
        unknown: names that match no sequence of the dataset, with the closest ones in words.
        first_rows: how first rows lie beside the annotation; None where none could be compared.
        repeats: how many repeats were averaged (the most of any sequence).
        deviation: standard deviation of scores over repeats, empty where there is one.
    """

    unreadable: dict[str, str] = field(default_factory=dict)
    unknown: dict[str, str] = field(default_factory=dict)
    first_rows: FirstRows | None = None
    repeats: int = 1
    deviation: dict[str, float] = field(default_factory=dict)


def runs_of(runs: Sequence[Run], dataset: str) -> list[Run]:
    """Without the runs that are stored as those of other datasets, where any is of this one."""
    is_this = [bool(run.dataset) and names_dataset(run.dataset, dataset) for run in runs]
    if not any(is_this):
        return list(runs)
    return [run for run, kept in zip(runs, is_this, strict=True) if kept or not run.dataset]


@dataclass(frozen=True, slots=True)
class ScoredRepeats:
    """What comes out of scoring one run, by sequence; filled step by step.

    Attributes:
        repeats: scores of every repeat.
        strict: success AUC under the protocol `strict`, the mean over repeats, where that is asked.
        first_rows: the first box of the first repeat.
        unreadable: why a sequence was left out.
    """

    repeats: dict[str, list[SequenceScores]] = field(default_factory=dict)
    strict: list[float] = field(default_factory=list)
    first_rows: dict[str, Box] = field(default_factory=dict)
    unreadable: dict[str, str] = field(default_factory=dict)


def foreign_notes(
    run: Run, dataset: Dataset, scored: ScoredRepeats, protocol: Protocol
) -> ForeignNotes:
    """Gather what is told of a run beside its scores."""
    truth = {s.name: s.boxes[0] for s in dataset if len(s.boxes)}
    counts = [len(scores) for scores in scored.repeats.values()]
    each = scored.repeats.values()
    totals = [[scores[number] for scores in each] for number in range(min(counts, default=1))]
    return ForeignNotes(
        unreadable=dict(scored.unreadable),
        unknown=unknown_names(run.finished(), dataset),
        first_rows=compare_first_rows(scored.first_rows, truth),
        repeats=max(counts, default=1),
        deviation=_deviation(totals, protocol),
    )


def unknown_names(names: Iterable[str], dataset: Dataset) -> dict[str, str]:
    """Names that the dataset does not have, the first few with the closest that it has."""
    known = [sequence.name for sequence in dataset]
    unknown = [n for n in names if n not in dataset and n not in dataset.unannotated]
    near = {name: closest(name, known, 1).removeprefix("; ") for name in unknown[:_MOST_NAMES]}
    return {name: near.get(name, "") for name in unknown}


def _deviation(repeats: list[list[SequenceScores]], protocol: Protocol) -> dict[str, float]:
    if len(repeats) < 2:
        return {}
    totals = [summarize(scores, protocol) for scores in repeats]
    values = {name: [getattr(total, name) for total in totals] for name in _DEVIATING}
    found = {name: float(np.std(value, ddof=1)) for name, value in values.items()}
    return {name: value for name, value in found.items() if np.isfinite(value)}
