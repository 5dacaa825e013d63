"""Where sequences are tracked: in this process, or in spawned worker processes."""

import contextlib
import multiprocessing
import signal
import threading
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeAlias

from nat2024 import types
from nat2024.datasets.prefetch import AHEAD
from nat2024.engine.one_pass import FrameCallback, track_sequence
from nat2024.engine.plan import Combination
from nat2024.errors import NatBenchError
from nat2024.interfaces import Tracker
from nat2024.registry import load_plugin_file
from nat2024.store import OnBadFrame, RunFolder

Progress: TypeAlias = Callable[[int, str], Any]
"""Called with the frames done since the last call, and what they belong to."""


@dataclass(frozen=True, slots=True)
class Job:
    """One sequence of one combination, how it is read, and where its result goes."""

    combination: Combination
    sequence: types.Sequence
    folder: str
    on_bad_frame: OnBadFrame = "error"
    ahead: int = AHEAD

    @property
    def title(self) -> str:
        """Run and sequence, for people."""
        return f"{self.combination.run}, {self.sequence.name}"


@dataclass(frozen=True, slots=True)
class Outcome:
    """What became of a job; `reason` is empty where its result is stored."""

    job: Job
    reason: str = ""


class Trackers:
    """Created trackers, kept so that a network is built once for all sequences of a run."""

    def __init__(self) -> None:
        self._made: dict[str, Tracker] = {}

    def get(self, combination: Combination) -> Tracker:
        """The tracker of a combination."""
        if combination.run not in self._made:
            self._made[combination.run], _ = combination.create()
        return self._made[combination.run]

    def keep(self, combination: Combination, tracker: Tracker) -> None:
        """Use a tracker that has been created already."""
        self._made[combination.run] = tracker


def run_job(job: Job, trackers: Trackers, on_frame: FrameCallback | None = None) -> Outcome:
    """Track one sequence and store its result; a failure is told, never raised."""
    try:
        track = track_sequence(
            trackers.get(job.combination),
            job.sequence,
            on_frame,
            on_bad_frame=job.on_bad_frame,
            ahead=job.ahead,
        )
        RunFolder(job.folder).write(job.sequence.name, track)
    except (NatBenchError, OSError) as error:
        return Outcome(job, str(error))
    return Outcome(job)


@contextlib.contextmanager
def computing_threads(count: int) -> Iterator[None]:
    """Let torch and OpenCV compute on `count` threads, and restore what was set before."""
    import cv2
    import torch

    before = torch.get_num_threads(), cv2.getNumThreads()
    torch.set_num_threads(count)
    cv2.setNumThreads(count)
    try:
        yield
    finally:
        torch.set_num_threads(before[0])
        cv2.setNumThreads(before[1])


def run_in_process(
    jobs: Sequence[Job], trackers: Trackers, progress: Progress
) -> Iterator[Outcome]:
    """Run jobs one after another in this process."""
    for job in jobs:
        yield run_job(job, trackers, partial(progress, 1, job.title))


def run_in_workers(
    jobs: Sequence[Job],
    workers: int,
    threads: int,
    plugins: tuple[str, ...],
    progress: Progress,
) -> Iterator[Outcome]:
    """Run jobs in spawned worker processes, each with its own trackers.

    A worker that dies breaks the whole pool. The jobs that it may have been on are then run one
    by one, so that only the guilty one fails, and the others go into a new pool.

    Args:
        jobs: what to do.
        workers: number of processes.
        threads: computing threads of each.
        plugins: plugin files to load in each.
        progress: told of each finished sequence.
    """
    waiting = list(jobs)
    while waiting:
        unfinished = yield from _run_pool(waiting, workers, threads, plugins, progress)
        suspects, waiting = unfinished[:workers], unfinished[workers:]
        for job in suspects:
            if (yield from _run_pool([job], 1, threads, plugins, progress)):
                yield Outcome(job, "its worker process died (out of memory or a crashed library)")


def _run_pool(
    jobs: Sequence[Job],
    workers: int,
    threads: int,
    plugins: tuple[str, ...],
    progress: Progress,
) -> Generator[Outcome, None, list[Job]]:
    """Run jobs in one pool; returns those without an outcome, in order, where the pool broke."""
    pool = ProcessPoolExecutor(
        min(workers, len(jobs)),
        mp_context=multiprocessing.get_context("spawn"),
        initializer=_start_worker,
        initargs=(threads, plugins),
    )
    done: set[int] = set()
    before = set(multiprocessing.active_children())
    try:
        futures: dict[Future[Outcome], int] = {}
        with contextlib.suppress(BrokenProcessPool), _born_deaf_to_interrupts():
            for number, job in enumerate(jobs):
                futures[pool.submit(_run_in_worker, job)] = number
        for future in as_completed(futures):
            with contextlib.suppress(BrokenProcessPool):
                outcome = future.result()
                done.add(futures[future])
                progress(len(outcome.job.sequence), outcome.job.title)
                yield outcome
    except BaseException:  # stopped from outside: nobody waits for what is still running
        pool.shutdown(wait=False, cancel_futures=True)
        for worker in set(multiprocessing.active_children()) - before:
            worker.terminate()
        raise
    pool.shutdown()
    return [job for number, job in enumerate(jobs) if number not in done]


@contextlib.contextmanager
def _born_deaf_to_interrupts() -> Iterator[None]:
    """Processes that are started here ignore Ctrl-C: stopping them is their parent's business."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    handler = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, handler)


_worker_trackers = Trackers()


def _start_worker(threads: int, plugins: tuple[str, ...]) -> None:
    import cv2
    import torch

    torch.set_num_threads(threads)
    cv2.setNumThreads(threads)
    for source in plugins:
        load_plugin_file(source)


def _run_in_worker(job: Job) -> Outcome:
    return run_job(job, _worker_trackers)
