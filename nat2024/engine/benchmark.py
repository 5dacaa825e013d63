"""The main job: every combination over every sequence, resumable, failures kept apart."""

import contextlib
import importlib.metadata
import logging
import platform
import subprocess
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import get_args

from nat2024.datasets.prefetch import AHEAD
from nat2024.devices import check_device
from nat2024.engine.plan import Combination, describe
from nat2024.engine.workers import (
    Job,
    Outcome,
    Progress,
    Trackers,
    computing_threads,
    run_in_process,
    run_in_workers,
)
from nat2024.errors import DatasetIncomplete, NatBenchError, ResultConflict, UsageError
from nat2024.store import (
    DatasetRecord,
    Manifest,
    OnBadFrame,
    RunFolder,
    Session,
    StageTimes,
    open_run,
)
from nat2024.types import Dataset, Sequence

log = logging.getLogger("nat2024")

_VERSIONED = ("nat-bench", "numpy", "opencv-python-headless", "torch")


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


@dataclass(slots=True)
class _Run:
    """One combination on its way: its folder, manifest and open sequences."""

    combination: Combination
    folder: RunFolder
    manifest: Manifest
    missing: list[str]


def run_benchmark(
    combinations: Iterable[Combination],
    dataset: Dataset,
    results: str | Path = "results",
    *,
    workers: int = 1,
    threads: int = 1,
    on_bad_frame: OnBadFrame = "error",
    read_ahead: int = AHEAD,
    plugins: tuple[str, ...] = (),
    progress: Progress = _no_progress,
) -> BenchmarkReport:
    """Track every sequence with every combination and store what comes out.

    Finished sequences are never tracked again. All combinations are created, and all run folders
    checked, before the first frame is tracked, so that wrong options or weights cost nothing.

    Args:
        combinations: from `combine`.
        dataset: the sequences.
        results: `RESULTS/DATASET/RUN/SEQUENCE.txt` is written.
        workers: number of processes; results do not depend on it.
        threads: computing threads of each worker; part of what a result depends on.
        on_bad_frame: as in `track_sequence`; part of what a result depends on.
        read_ahead: frames that are decoded ahead of the tracker; results do not depend on it.
        plugins: plugin files that spawned workers must load.
        progress: called with frames done since the last call and what is being tracked.

    Raises:
        UsageError: workers or threads below 1, read_ahead below 0, or the device is not there.
        DatasetIncomplete: the dataset has no sequence to run.
        ResultConflict: a run folder was made with other settings.
        WeightsMissing, WeightsMismatch, InvalidOption: a combination cannot be created.
    """
    combinations = list(combinations)
    _check(combinations, dataset, workers, threads)
    _check_reading(on_bad_frame, read_ahead)
    record = _record(dataset)
    folder = Path(results) / dataset.name
    trackers = Trackers()
    with computing_threads(threads):
        settings = partial(describe, dataset=record, threads=threads, on_bad_frame=on_bad_frame)
        runs = [_open(one, trackers, dataset, folder, settings) for one in combinations]
        for line in dict.fromkeys(line for run in runs for line in _bundled_weights(run.manifest)):
            log.info("%s", line)
        jobs = [
            Job(run.combination, dataset[name], str(run.folder.path), on_bad_frame, read_ahead)
            for run in runs
            for name in run.missing
        ]
        for run in runs:
            _start(run, workers, read_ahead)
        if workers == 1 or len(jobs) <= 1:
            outcomes = run_in_process(jobs, trackers, progress)
        else:
            outcomes = run_in_workers(jobs, workers, threads, plugins, progress)
        by_name = {run.combination.run: run for run in runs}
        failures = [
            failure
            for outcome in outcomes
            for failure in _note(outcome, by_name[outcome.job.combination.run])
        ]
        for run in runs:
            _finish(run)
    return BenchmarkReport(
        folder,
        tuple(by_name),
        tracked=len(jobs) - len(failures),
        skipped=len(runs) * len(dataset) - len(jobs),
        failures=tuple(failures),
    )


def _record(dataset: Dataset) -> DatasetRecord:
    origin = dataset.origin
    if origin is None:
        return DatasetRecord(dataset.name)
    return DatasetRecord(dataset.name, origin.source, origin.root, origin.lenient, origin.rule)


def _check(combinations: list[Combination], dataset: Dataset, workers: int, threads: int) -> None:
    if workers < 1 or threads < 1:
        msg = f"workers and threads must be at least 1, not {workers} and {threads}"
        raise UsageError(msg)
    if not len(dataset):
        msg = f"dataset {dataset.name} has no annotated sequence to run"
        raise DatasetIncomplete(msg)
    for device in {one.device for one in combinations}:
        check_device(device)


def _check_reading(on_bad_frame: str, read_ahead: int) -> None:
    if on_bad_frame not in get_args(OnBadFrame):
        msg = f"on_bad_frame {on_bad_frame!r} is none of {', '.join(get_args(OnBadFrame))}"
        raise UsageError(msg)
    if read_ahead < 0:
        msg = f"read_ahead must be 0 or more, not {read_ahead}"
        raise UsageError(msg)


def _open(
    combination: Combination,
    trackers: Trackers,
    dataset: Dataset,
    folder: Path,
    settings: Callable[..., Manifest],
) -> _Run:
    tracker, enhancer = combination.create()
    trackers.keep(combination, tracker)
    run_folder = RunFolder(folder / combination.run)
    manifest = open_run(run_folder, settings(combination, tracker, enhancer))
    missing = [s.name for s in dataset if not _is_finished(run_folder, manifest, s)]
    manifest.starts |= {name: dataset[name].start_digest() for name in missing}
    return _Run(combination, run_folder, manifest, missing)


def _bundled_weights(manifest: Manifest) -> Iterator[str]:
    """A line for each plugin of a run whose weights come with a package."""
    for plugin in (manifest.tracker, manifest.enhancer):
        if plugin and plugin.weights and plugin.weights.origin == "bundled":
            yield (
                f"{plugin.shown}: weights {plugin.weights.known_as}, which come with the package; "
                f"others by --weights {plugin.title}=PATH or nat-bench weights import {plugin.name}"
            )


def _start(run: _Run, workers: int, read_ahead: int) -> None:
    """Open a session, in a run that has something left to do."""
    if run.missing:
        run.folder.clean()
        run.manifest.sessions.append(
            Session(
                _timestamp(),
                workers=workers,
                read_ahead=read_ahead,
                versions=_versions(),
                machine=_machine(),
            )
        )
        run.folder.write_manifest(run.manifest)


def _is_finished(folder: RunFolder, manifest: Manifest, sequence: Sequence) -> bool:
    if not folder.has(sequence.name):
        return False
    path, rows = folder.box_file(sequence.name), len(folder.boxes(sequence.name))
    if rows != len(sequence):
        msg = f"{path}: {rows} rows, but the sequence has {len(sequence)} frames; move it away"
        raise ResultConflict(msg)
    if manifest.starts.get(sequence.name, sequence.start_digest()) != sequence.start_digest():
        msg = (
            f"{path}: made on another dataset, whose {sequence.name} has another length or first "
            "box; move it away, or choose another --results folder"
        )
        raise ResultConflict(msg)
    return True


def _note(outcome: Outcome, run: _Run) -> list[Failure]:
    name = outcome.job.sequence.name
    if not outcome.reason:
        return []
    log.error("%s, %s: %s", run.combination.run, name, outcome.reason)
    run.manifest.failures[name] = outcome.reason
    return [Failure(run.combination.run, name, outcome.reason)]


def _finish(run: _Run) -> None:
    if run.missing:
        run.folder.clean()
        run.manifest.sessions[-1].finished = _timestamp()
        run.manifest.timing = _stage_times(run.folder)
        run.manifest.skipped_frames = run.folder.skipped_frames()
        _tell_skipped(run)
        failures = run.manifest.failures.items()
        run.manifest.failures = {n: why for n, why in failures if not run.folder.has(n)}
        run.folder.write_manifest(run.manifest)


def _stage_times(folder: RunFolder) -> StageTimes | None:
    try:
        return folder.stage_times()
    except NatBenchError as error:  # times are no reason to lose what was tracked
        log.warning("no timing: %s", error)
        return None


def _tell_skipped(run: _Run) -> None:
    for name, frames in run.manifest.skipped_frames.items():
        if name in run.missing:
            shown = ", ".join(map(str, frames[:10])) + (", ..." if len(frames) > 10 else "")
            log.warning(
                "%s, %s: %d frames cannot be read, the last box is repeated: %s (counted from 0)",
                run.combination.run,
                name,
                len(frames),
                shown,
            )


def _timestamp() -> str:
    return datetime.fromtimestamp(time.time(), UTC).isoformat(timespec="seconds")


def _versions() -> dict[str, str]:
    found = {"python": platform.python_version()}
    for name in _VERSIONED:
        try:
            found[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:  # another distribution brings OpenCV
            continue
    checkout = Path(__file__).parents[2]
    if (checkout / ".git").exists():
        command = ["git", "-C", str(checkout), "rev-parse", "HEAD"]
        with contextlib.suppress(OSError, subprocess.SubprocessError):
            found["revision"] = subprocess.run(
                command, capture_output=True, text=True, check=True, timeout=10
            ).stdout.strip()
    return found


def _machine() -> dict[str, str]:
    import torch

    machine = {"system": platform.platform(), "processor": platform.machine()}
    if torch.cuda.is_available():
        machine["cuda_device"] = torch.cuda.get_device_name()
    return machine
