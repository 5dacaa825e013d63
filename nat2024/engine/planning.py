"""Which units of work there are, and in which order: sequences shared, load balanced."""

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from heapq import heapreplace
from itertools import pairwise
from operator import attrgetter

from nat2024 import types
from nat2024.engine.lockstep import Reading
from nat2024.engine.plan import Combination
from nat2024.engine.units import Unit
from nat2024.errors import UsageError
from nat2024.types import Dataset

TOGETHER = 12
"""Combinations that share decoded frames at most: with more, a kill would lose more than is won."""

LANE_ROUNDS = 4
"""Sequences for each lane of a unit at most, where others work beside it; one process takes all."""

STEP_FRAMES = 2.4
"""What a step costs whatever its batch, in frames: 2.6 ms and 1.08 ms a frame on an H100."""

_UNITS_A_WORKER = 4  # enough small ones at the end that no worker waits long for the last


def plan_units(
    missing: Mapping[str, Sequence[Combination]],
    dataset: Dataset,
    reading: Reading,
    *,
    batches: Mapping[str, int],
    workers: int = 1,
    in_process: bool = False,
) -> list[Unit]:
    """Put jobs together into units.

    A sequence goes through all its missing combinations at once, so that it is decoded once; with
    several workers it is split by combinations until no unit is so large that others would wait
    for it at the end, and the longest go first. Where several sequences advance at once, a unit
    has as many more of them than lanes as lets all workers end soonest.

    Args:
        missing: by sequence, the combinations that have no result for it.
        dataset: the sequences.
        reading: how frames are read.
        batches: by run, how many sequences advance at once.
        workers: how many units run at a time.
        in_process: whether this process itself runs them, which loses nothing of a large unit.
    """
    groups: dict[tuple[int, tuple[str, ...]], list[types.Sequence]] = defaultdict(list)
    combinations = {c.run: c for some in missing.values() for c in some}
    for sequence in dataset:
        by_width: dict[int, list[str]] = defaultdict(list)
        for combination in missing.get(sequence.name, ()):
            by_width[batches[combination.run]].append(combination.run)
        for width, runs in by_width.items():
            groups[width, tuple(runs)].append(sequence)
    plans = []
    for rounds in _rounds([width for width, _ in groups], in_process=in_process):
        chunks = [
            ([combinations[run] for run in runs], chunk, width)
            for (width, runs), sequences in groups.items()
            for chunk in _chunks(sequences, width, workers, rounds)
        ]
        plans.append(_units(chunks, reading, workers))
    best = min(plans, key=lambda units: _time(units, workers))
    if workers > 1:
        return best
    place = {sequence.name: number for number, sequence in enumerate(dataset)}
    return sorted(best, key=lambda unit: place[unit.sequences[0].name])


def _rounds(widths: Iterable[int], *, in_process: bool) -> list[float]:
    """How many sequences a lane may get, to choose from; 0 shares all out among the workers."""
    if in_process or all(width == 1 for width in widths):
        return [float("inf")]
    return [1, 2, LANE_ROUNDS, 0]


def _units(
    chunks: Iterable[tuple[list[Combination], list[types.Sequence], int]],
    reading: Reading,
    workers: int,
) -> list[Unit]:
    """Combinations and sequences as units, the longest first."""
    chunks = list(chunks)
    total = sum(len(runs) * sum(map(len, chunk)) for runs, chunk, _ in chunks)
    largest = total / (workers * _UNITS_A_WORKER) if workers > 1 else float("inf")
    units = [
        Unit(tuple(part), tuple(chunk), reading, min(width, len(chunk)))
        for runs, chunk, width in chunks
        for part in _parts(runs, largest / max(1, sum(map(len, chunk))))
    ]
    return sorted(units, key=attrgetter("frames"), reverse=True)


def _time(units: Iterable[Unit], workers: int) -> float:
    """When the last worker ends, in frames of a large batch."""
    free = [0.0] * workers
    for unit in units:
        heapreplace(free, free[0] + cost(unit))
    return max(free)


def cost(unit: Unit) -> float:
    """What a unit costs, in frames of a large batch."""
    lanes = [0] * unit.lanes
    for sequence in unit.sequences:
        heapreplace(lanes, lanes[0] + len(sequence))
    return len(unit.combinations) * max(lanes) * STEP_FRAMES + unit.frames


def _chunks(
    sequences: list[types.Sequence], width: int, workers: int, rounds: float
) -> list[list[types.Sequence]]:
    """What goes through `width` lanes in one unit, the longest first; each alone without lanes.

    Sequences of like lengths go together, since lanes that are through wait for the last one. With
    0 rounds each worker gets some of all lengths: for few combinations and many workers.
    """
    if width == 1:
        return [[sequence] for sequence in sequences]
    if rounds:
        ordered = sorted(sequences, key=lambda s: (-len(s), s.name))
        size = min(len(ordered), width * rounds)
        return [ordered[start : start + int(size)] for start in range(0, len(ordered), int(size))]
    turns = -(-len(sequences) // (workers * width * LANE_ROUNDS))
    return evenly(sequences, min(workers * turns, -(-len(sequences) // width)))


def evenly(sequences: Iterable[types.Sequence], count: int) -> list[list[types.Sequence]]:
    """At most `count` parts of like numbers of frames, the longest sequences first in each."""
    parts: list[list[types.Sequence]] = [[] for _ in range(count)]
    frames = [0] * count
    for sequence in sorted(sequences, key=lambda s: (-len(s), s.name)):
        lightest = min(range(count), key=lambda part: (frames[part], len(parts[part])))
        parts[lightest].append(sequence)
        frames[lightest] += len(sequence)
    return [part for part in parts if part]


def _parts(combinations: list[Combination], room: float) -> Iterable[list[Combination]]:
    """Combinations in even parts of `room` at most; those with one enhancer stay side by side."""
    ordered = sorted(combinations, key=lambda c: c.enhancer.title if c.enhancer else "")
    count = -(-len(ordered) // max(1, min(TOGETHER, int(min(room, TOGETHER)))))
    bounds = [len(ordered) * part // count for part in range(count + 1)]
    return [ordered[start:end] for start, end in pairwise(bounds)]


def shard(dataset: Dataset, number: int, count: int) -> Dataset:
    """One of `count` parts of a dataset, of like numbers of frames; the same on every machine.

    Args:
        dataset: the sequences.
        number: which part, from 1 to `count`.
        count: how many parts; at most as many as there are sequences.

    Raises:
        UsageError: there is no such part.
    """
    if not 1 <= number <= count:
        msg = f"shard {number}/{count}: expected I/N with I from 1 to N"
        raise UsageError(msg)
    if count > len(dataset):
        msg = f"shard {number}/{count}: {dataset.name} has only {len(dataset)} sequences"
        raise UsageError(msg)
    return dataset.select([sequence.name for sequence in evenly(dataset, count)[number - 1]])
