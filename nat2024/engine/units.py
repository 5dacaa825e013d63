"""Units of work: sequences and the combinations that follow them together."""

from collections import defaultdict
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any, Protocol, TypeAlias, runtime_checkable

from nat2024 import types
from nat2024.engine.lockstep import Reading, track_together
from nat2024.engine.plan import Combination
from nat2024.engine.sharing import SharedFrames
from nat2024.errors import NatBenchError
from nat2024.interfaces import BatchEnhancer, Enhancer, Tracker
from nat2024.store import Track

Progress: TypeAlias = Callable[[int, str], Any]
"""Called with the frames done since the last call, and what they belong to."""

Job: TypeAlias = tuple[str, str]
"""Name of a run, and of a sequence: what has one result file."""


@dataclass(frozen=True, slots=True)
class Unit:
    """Every one of some combinations on every one of some sequences, frame by frame together.

    Attributes:
        combinations: those that share an enhancer stand side by side.
        sequences: in the order in which they are begun.
        reading: how frames are read, and when a sequence is given up.
        lanes: how many sequences advance at once; several only where every combination advances
            in batches.
    """

    combinations: tuple[Combination, ...]
    sequences: tuple[types.Sequence, ...]
    reading: Reading
    lanes: int = 1

    @property
    def jobs(self) -> list[Job]:
        """What it has results for."""
        return [(c.run, s.name) for c in self.combinations for s in self.sequences]

    @property
    def frames(self) -> int:
        """How much there is to do, in frames of one tracker."""
        return len(self.combinations) * sum(map(len, self.sequences))

    @property
    def title(self) -> str:
        """For people."""
        runs, names = [c.run for c in self.combinations], [s.name for s in self.sequences]
        more = [f" and {len(texts) - 1} more" if texts[1:] else "" for texts in (runs, names)]
        return f"{runs[0]}{more[0]}, {names[0]}{more[1]}"

    def singles(self, jobs: set[Job]) -> "list[Unit]":
        """A unit for each of these jobs of it."""
        return [
            Unit((combination,), (sequence,), self.reading)
            for sequence in self.sequences
            for combination in self.combinations
            if (combination.run, sequence.name) in jobs
        ]

    @property
    def refills(self) -> bool:
        """Whether sequences wait for a lane: not all are begun at once."""
        return len(self.sequences) > self.lanes

    def narrowed(self, jobs: set[Job]) -> "list[Unit]":
        """Units for each of these jobs of it, none of which begins more sequences than at first.

        One that refilled its lanes is cut into units that do not; any other into single jobs.
        """
        if not self.refills:
            return self.singles(jobs)
        left: dict[frozenset[str], list[types.Sequence]] = defaultdict(list)
        for sequence in self.sequences:
            left[frozenset(run for run, name in jobs if name == sequence.name)].append(sequence)
        return [
            Unit(
                tuple(c for c in self.combinations if c.run in runs),
                tuple(sequences[start : start + self.lanes]),
                self.reading,
                self.lanes,
            )
            for runs, sequences in left.items()
            for start in range(0, len(sequences), self.lanes)
            if runs
        ]

    def on_device(self, device: str) -> "Unit":
        """The same on a device of its own, where it asks for any CUDA device."""
        chosen = [replace(c, device=device) if c.device == "cuda" else c for c in self.combinations]
        return replace(self, combinations=tuple(chosen))


@dataclass(frozen=True, slots=True)
class Outcome:
    """What became of a job: a track, or the reason why there is none."""

    run: str
    sequence: str
    track: Track | None = None
    reason: str = ""


@runtime_checkable
class HasTwins(Protocol):
    """A tracker whose network can serve other trackers too."""

    def twin(self, enhancer: BatchEnhancer | None, /) -> Tracker:
        """Another tracker over the same network, with an enhancer and a state of its own."""
        ...


class Trackers:
    """Created trackers, kept so that a network is built once for all sequences of a run.

    One enhancer serves all trackers that ask for the same one, and so do the frames it enhances;
    one network serves a tracker with every enhancer.
    """

    def __init__(self) -> None:
        self._made: dict[str, Tracker] = {}
        self._asked: dict[str, Combination] = {}
        self._enhancers: dict[str, tuple[Enhancer, SharedFrames]] = {}

    def has(self, combination: Combination) -> bool:
        """Whether the tracker of a combination has been created."""
        return combination.run in self._made

    def get(self, combination: Combination) -> Tracker:
        """The tracker of a combination."""
        if not self.has(combination):
            self.create(combination)
        return self._made[combination.run]

    def create(self, combination: Combination) -> tuple[Tracker, Enhancer | None]:
        """Create, and keep, the tracker of a combination; also its bare enhancer."""
        enhancer = shared = None
        if combination.enhancer is not None:
            title = combination.enhancer.title
            if title not in self._enhancers:
                made = combination.create_enhancer()
                assert made is not None
                self._enhancers[title] = made, SharedFrames()
            enhancer, shared = self._enhancers[title]
        timed = combination.timed(enhancer, shared)
        relative = self._relative_of(combination)
        tracker = relative.twin(timed) if relative else combination.create_tracker(timed)
        self._made[combination.run], self._asked[combination.run] = tracker, combination
        return tracker, enhancer

    def _relative_of(self, combination: Combination) -> HasTwins | None:
        """A tracker that was created by the same name, weights and options on the same device."""
        for run, tracker in self._made.items():
            other = self._asked[run]
            if (
                isinstance(tracker, HasTwins)
                and other.device == combination.device
                and replace(other.tracker, label="") == replace(combination.tracker, label="")
            ):
                return tracker
        return None


def run_unit(unit: Unit, trackers: Trackers, progress: Progress) -> Iterator[Outcome]:
    """Track; an `Outcome` for each job, as soon as it is known. Failures are told, never raised."""
    made, combinations = [], []
    for combination in unit.combinations:
        try:
            made.append(trackers.get(combination))
            combinations.append(combination)
        except NatBenchError as error:
            for sequence in unit.sequences:
                yield Outcome(combination.run, sequence.name, reason=str(error))
    if not made:
        return
    progress(0, unit.title)  # trackers are built, tracking begins

    def told(tracker: int, sequence: int) -> None:
        progress(1, f"{combinations[tracker].run}, {unit.sequences[sequence].name}")

    for finish in track_together(made, unit.sequences, unit.reading, told, lanes=unit.lanes):
        run, name = combinations[finish.tracker].run, unit.sequences[finish.sequence].name
        if isinstance(finish.result, NatBenchError):
            yield Outcome(run, name, reason=str(finish.result))
        else:
            yield Outcome(run, name, finish.result)
