"""The main job: every combination over every sequence, resumable, failures kept apart."""

import logging
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, get_args

from nat2024.datasets.prefetch import AHEAD
from nat2024.devices import check_device
from nat2024.engine.active_run import ActiveRun, bundled_weights
from nat2024.engine.lockstep import Reading
from nat2024.engine.machine import machine, process_name, timestamp, versions
from nat2024.engine.methods import BatchTracker
from nat2024.engine.plan import (
    Combination,
    as_begun,
    describe,
    in_torch_for_auto,
    untouched_options,
)
from nat2024.engine.planning import plan_units
from nat2024.engine.units import Outcome, Progress, Trackers, Unit
from nat2024.engine.workers import Setting, computing_threads, run_in_process, run_in_workers
from nat2024.errors import DatasetIncomplete, UsageError
from nat2024.store import DatasetRecord, OnBadFrame, RunFolder, Session
from nat2024.types import Dataset

if TYPE_CHECKING:
    from distributed import Client

log = logging.getLogger("nat2024")


def _no_progress(_frames: int, _what: str) -> None:
    pass


@dataclass(frozen=True, slots=True)
class Failure:
    """A sequence without a result, and why."""

    run: str
    sequence: str
    reason: str


@dataclass(frozen=True, slots=True)
class BenchmarkReport:
    """What `run_benchmark` did.

    Attributes:
        folder: `RESULTS/DATASET`.
        runs: names of the run folders.
        tracked: number of sequences tracked now.
        skipped: number of sequences that were finished before.
        failures: sequences without a result.
    """

    folder: Path
    runs: tuple[str, ...]
    tracked: int
    skipped: int
    failures: tuple[Failure, ...]


@dataclass(frozen=True, slots=True)
class _Way:
    """How the work is done; results do not depend on it, but for `threads` and `batch`."""

    reading: Reading
    setting: Setting
    workers: int
    batch: int
    cluster: "str | Client | None"
    shard: str

    @property
    def in_process(self) -> bool:
        """Whether this very process tracks; nobody could end it there where it hangs."""
        return self.cluster is None and self.workers == 1 and self.reading.timeout is None


def run_benchmark(
    combinations: Iterable[Combination],
    dataset: Dataset,
    results: str | Path = "results",
    *,
    workers: int = 1,
    threads: int = 1,
    batch: int = 1,
    on_bad_frame: OnBadFrame = "error",
    read_ahead: int = AHEAD,
    timeout: float | None = None,
    retries: int = 2,
    cluster: "str | Client | None" = None,
    shard: str = "",
    plugins: tuple[str, ...] = (),
    progress: Progress = _no_progress,
) -> BenchmarkReport:
    """Track every sequence with every combination and store what comes out.

    Finished sequences are never tracked again. All combinations are created, and all run folders
    checked, before the first frame is tracked, so that wrong options or weights cost nothing. A
    sequence goes through all its combinations at once, frame by frame, and is decoded once.

    Args:
        combinations: from `combine`.
        dataset: the sequences.
        results: `RESULTS/DATASET/RUN/SEQUENCE.txt` is written, by this process alone.
        workers: number of processes, or of jobs of a cluster; results do not depend on it.
        threads: computing threads of each worker; part of what a result depends on.
        batch: sequences that advance in one forward, where a tracker can; part of what a result
            depends on, in its last digits.
        on_bad_frame: as in `track_sequence`; part of what a result depends on.
        read_ahead: frames that are decoded ahead of the tracker; results do not depend on it.
        timeout: seconds that a combination may take for a sequence; then that fails.
        retries: how often a sequence is tried again whose worker died.
        cluster: address of a Dask scheduler, "local", "slurm", or a `distributed.Client`.
        shard: `I/N` where `dataset` is one of N parts of another, for whom brings them together.
        plugins: plugin files that spawned workers must load.
        progress: called with frames done since the last call and what is being tracked.

    Raises:
        UsageError: workers, threads or batch below 1, other numbers below 0, or the device is not
            there; on a cluster it need be on workers only.
        DatasetIncomplete: the dataset has no sequence to run.
        ResultConflict: a run folder was made with other settings.
        WeightsMissing, WeightsMismatch, InvalidOption: a combination cannot be created.
        ClusterFailed: the cluster cannot be had, or cannot do this work.
    """
    combinations = list(combinations)
    way = _Way(
        Reading(on_bad_frame, read_ahead, timeout),
        Setting(threads, plugins, retries, timeout),
        workers,
        batch,
        cluster,
        shard,
    )
    _check(combinations, dataset, way)
    folder = Path(results) / dataset.name
    trackers = Trackers()
    with computing_threads(threads):
        runs = [
            _open(one, trackers if way.in_process else Trackers(), dataset, folder, way)
            for one in combinations  # workers build their own: none stays in memory here
        ]
        for line in dict.fromkeys(line for run in runs for line in bundled_weights(run.wanted)):
            log.info("%s", line)
        units = _plan(runs, dataset, way)
        session = _session(units, way)
        for run in runs:
            run.begin(session)
        by_name = {run.combination.run: run for run in runs}
        failures = []
        for outcome in _work(units, runs, trackers, way, progress):
            run = by_name[outcome.run]
            if not run.keep(outcome):
                reason = run.failures[outcome.sequence]
                failures.append(Failure(outcome.run, outcome.sequence, reason))
        for run in runs:
            run.finish()
    jobs = sum(len(run.missing) for run in runs)
    return BenchmarkReport(
        folder,
        tuple(by_name),
        tracked=jobs - len(failures),
        skipped=len(runs) * len(dataset) - jobs,
        failures=tuple(failures),
    )


def _check(combinations: list[Combination], dataset: Dataset, way: _Way) -> None:
    counts = {"workers": way.workers, "threads": way.setting.threads, "batch": way.batch}
    for name, count in counts.items():
        if count < 1:
            msg = f"{name} must be at least 1, not {count}"
            raise UsageError(msg)
    reading, timeout = way.reading, way.reading.timeout
    if reading.on_bad_frame not in get_args(OnBadFrame):
        known = ", ".join(get_args(OnBadFrame))
        msg = f"on_bad_frame {reading.on_bad_frame!r} is none of {known}"
        raise UsageError(msg)
    for name, count in {"read_ahead": reading.ahead, "retries": way.setting.retries}.items():
        if count < 0:
            msg = f"{name} must be 0 or more, not {count}"
            raise UsageError(msg)
    if timeout is not None and not timeout > 0:
        msg = f"timeout must be above 0 seconds, not {timeout}"
        raise UsageError(msg)
    if not len(dataset):
        msg = f"dataset {dataset.name} has no annotated sequence to run"
        raise DatasetIncomplete(msg)
    for device in {one.device for one in combinations}:
        if way.cluster is None or not device.startswith("cuda"):  # else workers say what they have
            check_device(device)


def _open(
    combination: Combination, trackers: Trackers, dataset: Dataset, folder: Path, way: _Way
) -> ActiveRun:
    combination = as_begun(combination, RunFolder(folder / combination.run).manifest())
    created = combination
    if way.cluster is not None and not _is_there(combination.device):
        combination = in_torch_for_auto(combination)
        created = replace(combination, device="cpu")
    tracker, enhancer = trackers.create(created)
    batch = way.batch if isinstance(tracker, BatchTracker) else 1
    if batch != way.batch:
        title = combination.tracker.title
        log.info("%s takes one sequence at a time, whatever --batch says", title)
    threads, on_bad_frame = way.setting.threads, way.reading.on_bad_frame
    wanted = describe(
        combination, tracker, enhancer, _record(dataset), threads, on_bad_frame, batch
    )
    untouched = untouched_options(combination, tracker, enhancer)
    return ActiveRun.open(combination, wanted, untouched, dataset, folder)


def _is_there(device: str) -> bool:
    try:
        check_device(device)
    except UsageError:
        return False
    return True


def _record(dataset: Dataset) -> DatasetRecord:
    origin = dataset.origin
    if origin is None:
        return DatasetRecord(dataset.name)
    return DatasetRecord(dataset.name, origin.source, origin.root, origin.lenient, origin.rule)


def _plan(runs: list[ActiveRun], dataset: Dataset, way: _Way) -> list[Unit]:
    unfinished = [(run.combination, frozenset(run.missing)) for run in runs]
    missing = {
        sequence.name: [one for one, names in unfinished if sequence.name in names]
        for sequence in dataset
    }
    batches = {run.combination.run: run.wanted.batch for run in runs}
    jobs = sum(map(len, missing.values()))
    at_a_time = 1 if way.in_process else min(way.workers, max(1, jobs))
    if way.cluster is not None and any(missing.values()):
        from nat2024.engine.cluster import count_places

        at_a_time = count_places(way.cluster, way.workers)
    return plan_units(
        missing,
        dataset,
        way.reading,
        batches=batches,
        workers=at_a_time,
        in_process=way.in_process,
    )


def _session(units: list[Unit], way: _Way) -> Session:
    return Session(
        timestamp(),
        workers=way.workers,
        read_ahead=way.reading.ahead,
        together=max((len(unit.combinations) for unit in units), default=1),
        cluster="" if way.cluster is None else _cluster_name(way.cluster),
        shard=way.shard,
        process=process_name(),
        versions=versions(),
        machine=machine(),
    )


def _cluster_name(cluster: "str | Client") -> str:
    return cluster if isinstance(cluster, str) else str(cluster.scheduler.address)  # type: ignore[union-attr]


def _work(
    units: list[Unit],
    runs: list[ActiveRun],
    trackers: Trackers,
    way: _Way,
    progress: Progress,
) -> Iterator[Outcome]:
    if not units or way.in_process:
        return run_in_process(units, trackers, progress)
    if way.cluster is None:
        jobs = sum(len(unit.jobs) for unit in units)
        return run_in_workers(units, min(way.workers, jobs), way.setting, progress)
    from nat2024.engine.cluster import run_on_cluster

    expected = {run.combination.run: run.wanted for run in runs}
    return run_on_cluster(way.cluster, units, expected, way.workers, way.setting, progress)
