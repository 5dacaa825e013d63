"""The full study on other machines: the engine's own plan, carried out on paper.

Five trackers with eleven enhancer settings on UAVDark135 and NAT2024-2, whose published lengths
are known. `growth.py` measures the rates; this module computes what follows from them.
"""

import functools
import heapq
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from statistics import fmean

import growth_jobs

from nat2024.engine import Combination
from nat2024.engine.plan import PluginSpec
from nat2024.engine.planning import STEP_FRAMES, cost, plan_units
from nat2024.engine.units import Unit
from nat2024.types import Dataset

DATASETS = ("uavdark135", "nat2024_2")
TRACKERS = ("siamrpnpp", "siamapn", "siamapnpp", "hift", "lpat")
ENHANCERS = (
    "none",
    "ldenhancer",
    "darklighter",
    "dcepp",
    "enlightengan",
    "highlightnet",
    "kindpp",
    "lime",
    "llve",
    "ruas",
    "sct",
)


@dataclass(frozen=True, slots=True)
class Rates:
    """What the study is computed from.

    Attributes:
        frame_ms: processor time of a frame of siamrpnpp with ldenhancer on one core.
        decode_ms: processor time of decoding a 1920x1080 JPEG and handing it on.
        jpeg_mb: size of such a file.
        unit_ms: what a unit of work costs the process that hands it out on a cluster.
        result_ms: what writing one result costs that process.
        start_seconds: until a worker process tracks its first frame.
    """

    frame_ms: float
    decode_ms: float
    jpeg_mb: float
    unit_ms: float
    result_ms: float
    start_seconds: float


@dataclass(frozen=True, slots=True)
class Machine:
    """Workers that track alike.

    Attributes:
        name: in words.
        workers: devices or cores, one worker each.
        rate: tracked frames a second of each.
        batch: sequences in one forward.
    """

    name: str
    workers: int
    rate: float
    batch: int = 1


@dataclass(frozen=True, slots=True)
class Forecast:
    """The study on a machine.

    Attributes:
        seconds: from the first frame to the last result, both datasets one after the other.
        busy: share 0..1 of the workers' time in which they track.
        units: how many units of work there are.
        together: combinations that share a decoded frame, on average over decoded frames.
        unit_seconds: of the average unit.
        serial_seconds: of them, what the command that hands it out does itself.
    """

    seconds: float
    busy: float
    units: int
    together: float
    unit_seconds: float
    serial_seconds: float


def combinations() -> list[Combination]:
    """All 55."""
    return [
        Combination(PluginSpec(tracker), None if enhancer == "none" else PluginSpec(enhancer))
        for tracker in TRACKERS
        for enhancer in ENHANCERS
    ]


@functools.cache
def lengths(name: str) -> tuple[int, ...]:
    """Published numbers of frames of the sequences of a dataset."""
    from nat2024.datasets import registered_dataset

    return tuple(one.frames for one in registered_dataset(name).sequences.values())


def tracked_frames() -> int:
    """Frames of the study, each counted once for each combination."""
    return len(combinations()) * sum(sum(lengths(name)) for name in DATASETS)


def results_of_study() -> int:
    """Result files: one for each combination and sequence."""
    return len(combinations()) * sum(len(lengths(name)) for name in DATASETS)


@functools.cache
def plan(name: str, workers: int, batch: int) -> tuple[Unit, ...]:
    """Units of one dataset, in the order in which they are handed out."""
    from nat2024.engine.lockstep import Reading

    dataset: Dataset = growth_jobs.plain_dataset(lengths(name))
    runs = combinations()
    missing = {sequence.name: runs for sequence in dataset}
    batches = {run.run: batch for run in runs}
    alone = workers == 1
    units = plan_units(
        missing, dataset, Reading(), batches=batches, workers=workers, in_process=alone
    )
    return tuple(units)


def forwards(unit: Unit, batch: int) -> float:
    """Frames in full batches that take as long as a unit, whose last batches are not full."""
    return cost(unit) * batch / (batch + STEP_FRAMES)


def carry_out(seconds: Sequence[float], workers: int, serial: Sequence[float] = ()) -> float:
    """When the last of some units is done, each given to the first free worker in their order.

    Args:
        seconds: of each unit.
        workers: how many there are.
        serial: seconds that one process needs for each unit, one after another; none if empty.
    """
    free = [0.0] * workers
    handed = 0.0
    for one, needed in zip(seconds, serial or [0.0] * len(seconds), strict=True):
        handed = max(handed, heapq.heappop(free)) + needed
        heapq.heappush(free, handed + one)
    return max(free)


def serial_seconds(unit: Unit, rates: Rates) -> float:
    """What the command itself does for a unit; writing one result is in `unit_ms` already."""
    return (rates.unit_ms + (len(unit.jobs) - 1) * rates.result_ms) / 1000


def forecast(machine: Machine, rates: Rates) -> Forecast:
    """The study on a machine, dataset by dataset, as two commands would do it."""
    total = 0.0
    units: list[Unit] = []
    for name in DATASETS:
        planned = plan(name, machine.workers, machine.batch)
        units += planned
        seconds = [forwards(unit, machine.batch) / machine.rate for unit in planned]
        serial = [serial_seconds(unit, rates) for unit in planned] if machine.workers > 1 else ()
        total += rates.start_seconds + carry_out(seconds, machine.workers, serial)
    decoded = sum(sum(map(len, unit.sequences)) for unit in units)
    ideal = tracked_frames() / machine.rate / machine.workers
    return Forecast(
        total,
        ideal / total,
        len(units),
        tracked_frames() / decoded,
        fmean(forwards(unit, machine.batch) for unit in units) / machine.rate,
        fmean(serial_seconds(unit, rates) for unit in units),
    )


@dataclass(frozen=True, slots=True)
class Limit:
    """Something that there is not more of.

    Attributes:
        what: in words.
        cost: in words.
        workers: with how many workers it is used up.
    """

    what: str
    cost: str
    workers: float


def limits(machine: Machine, rates: Rates, cores: int, storage: float) -> list[Limit]:
    """What is used up with how many workers of this kind, the first one first.

    Args:
        machine: tells rate, batch and the number of workers that frames are shared for.
        rates: as measured.
        cores: for each worker.
        storage: MB a second that frames are read at, of all workers together.
    """
    seen = forecast(machine, rates)
    decoded = machine.rate / seen.together  # frames a second of each worker
    decoding = decoded * rates.decode_ms / 1000
    reading = decoded * rates.jpeg_mb
    found = [
        Limit(
            f"one storage of {storage:,.0f} MB/s for all",
            f"{reading:.1f} MB/s a worker",
            storage / reading,
        ),
        Limit(
            "the command, which hands out units and writes results",
            f"{seen.serial_seconds:.2f} s a unit of {seen.unit_seconds:.0f} s",
            seen.unit_seconds / seen.serial_seconds,
        ),
        Limit(
            "the last units: a tenth of the time goes into waiting for them",
            f"longest sequence {max(lengths(DATASETS[0])):,} frames, batch {machine.batch}",
            busy_until(machine, rates, 0.9),
        ),
        Limit(
            f"decoding on {cores} cores a worker",
            f"{decoding:.1f} cores busy a worker",
            0.0 if decoding > cores else float("inf"),
        ),
    ]
    return sorted(found, key=lambda limit: limit.workers)


def busy_until(machine: Machine, rates: Rates, share: float) -> float:
    """The largest power of two of workers that track for this share of what one alone does."""

    def busy(workers: int) -> float:
        other = Machine(machine.name, workers, machine.rate, machine.batch)
        return forecast(other, rates).busy

    wanted = share * busy(1)
    return float(largest_power(lambda workers: busy(workers) >= wanted))


def largest_power(holds: Callable[[int], bool], most: int = 4096) -> int:
    """The largest power of two up to which something holds, 0 where it never does."""
    workers = 1
    while workers <= most and holds(workers):
        workers *= 2
    return workers // 2


def dearness(enhancers: Sequence[str]) -> float:
    """Arithmetic of the average frame over these settings, against siamrpnpp with ldenhancer.

    Multiply-accumulates are those of the plugins' cards.
    """
    from nat2024.registry import Kind, load_plugin

    def arithmetic(name: str, kind: Kind) -> float:
        macs: int = load_plugin(name, kind).card.macs
        return macs

    own = fmean(arithmetic(name, "tracker") for name in TRACKERS)
    added = fmean(arithmetic(name, "enhancer") for name in enhancers)
    base = arithmetic("siamrpnpp", "tracker") + arithmetic("ldenhancer", "enhancer")
    return (own + added) / base
