"""Where units of work run: in this process, or in spawned worker processes.

Workers compute and tell their parent what came out, which alone writes it. A worker that dies, or
hangs, costs nothing but time: its unit is tried again, one job at a time, so that only a guilty
job fails. Workers end with their parent, however that ends.
"""

import contextlib
import itertools
import multiprocessing
import os
import signal
import threading
import time
from collections import Counter, deque
from collections.abc import Generator, Iterator, Sequence
from dataclasses import dataclass, field
from multiprocessing import connection as connections
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from typing import Any

from nat2024.engine.backends_used import run_and_note_backends
from nat2024.engine.kept_trackers import KeptTrackers
from nat2024.engine.planning import TOGETHER
from nat2024.engine.reporting import Throttled
from nat2024.engine.units import Job, Outcome, Progress, Trackers, Unit
from nat2024.errors import NatBenchError, UsageError
from nat2024.memory import keep_freed_memory
from nat2024.registry import load_plugin_file

DIED = "its worker process died (out of memory or a crashed library)"

_TELL_SECONDS = 0.1
_GRACE_SECONDS = 2.0  # between two words of a worker, over what a frame may take
_FALSE_STARTS = 5
_NEAR = 2 * TOGETHER  # units of like length, among which their order may wait
_THREAD_VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


@dataclass(frozen=True, slots=True)
class Setting:
    """What workers share.

    Attributes:
        threads: computing threads of each.
        plugins: plugin files to load in each.
        retries: how often a job is tried again whose worker died.
        timeout: seconds that a tracker may take for a sequence, so also for one frame.
        in_turn: whether workers of a cluster, all on one machine, take its CUDA devices in turn.
    """

    threads: int = 1
    plugins: tuple[str, ...] = ()
    retries: int = 2
    timeout: float | None = None
    in_turn: bool = False


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
    units: Sequence[Unit], trackers: Trackers, progress: Progress
) -> Iterator[Outcome]:
    """Run units one after another in this process."""
    for unit in units:
        yield from run_and_note_backends(unit, trackers, progress)


def run_in_workers(
    units: Sequence[Unit], workers: int, setting: Setting, progress: Progress
) -> Iterator[Outcome]:
    """Run units in spawned worker processes, each with its own trackers, the first units first.

    With several CUDA devices, and trackers that ask for any, workers take them in turn.

    Raises:
        NatBenchError: workers cannot start.
    """
    crew = _Crew(units, workers, setting, progress)
    try:
        yield from crew.work()
    finally:
        crew.end()


@dataclass(slots=True, eq=False)
class _Worker:
    """A worker process as its parent sees it."""

    process: BaseProcess
    wire: Connection
    device: str
    unit: Unit | None = None
    runs: frozenset[str] = frozenset()  # of its last unit, whose trackers it has
    pending: set[Job] = field(default_factory=set)
    is_ready: bool = False
    heard: float = 0.0


class _Crew:
    """Worker processes and what they have to do."""

    def __init__(
        self, units: Sequence[Unit], workers: int, setting: Setting, progress: Progress
    ) -> None:
        self._waiting = deque(units)
        self._setting, self._progress = setting, progress
        self._tries: Counter[Job] = Counter()
        self._false_starts = 0
        self._keeps_all = len({run for unit in units for run in _runs(unit)}) <= TOGETHER
        devices = _devices(units)
        self._places = [devices[number % len(devices)] for number in range(workers)]
        self._workers: list[_Worker] = []

    def work(self) -> Iterator[Outcome]:
        """Run everything."""
        while self._waiting or any(worker.unit for worker in self._workers):
            self._staff()
            yield from self._hand_out()
            for worker in self._heard():
                yield from self._listen(worker)
            yield from self._end_the_stuck()

    def end(self) -> None:
        """End all workers; nobody waits for what they are still doing."""
        for worker in self._workers:
            worker.process.kill()
        for worker in self._workers:
            worker.process.join()
            worker.wire.close()

    def _staff(self) -> None:
        """As many workers as there are places, while there is something for each of them."""
        busy = sum(worker.unit is not None for worker in self._workers)
        wanted = min(len(self._places), busy + len(self._waiting))
        taken = [worker.device for worker in self._workers]
        free = list(self._places)
        for device in taken:
            free.remove(device)
        with born_deaf_to_interrupts(), _thread_variables(self._setting.threads):
            while len(self._workers) < wanted:
                self._workers.append(_start(free.pop(0), self._setting))

    def _hand_out(self) -> Iterator[Outcome]:
        for worker in list(self._workers):
            if worker.is_ready and worker.unit is None and self._waiting:
                unit = self._take_unit(worker)
                worker.unit, worker.runs, worker.pending = unit, _runs(unit), set(unit.jobs)
                worker.heard = float("inf")  # until its trackers are built
                try:
                    worker.wire.send(unit.on_device(worker.device) if worker.device else unit)
                except OSError:
                    yield from self._bury(worker, DIED)

    def _take_unit(self, worker: _Worker) -> Unit:
        """The first one, or one near it whose trackers the worker has and need not build."""
        number = 0
        if not self._keeps_all:
            near = enumerate(itertools.islice(self._waiting, _NEAR))
            number = next((n for n, unit in near if _runs(unit) <= worker.runs), 0)
        unit = self._waiting[number]
        del self._waiting[number]
        return unit

    def _heard(self) -> list[_Worker]:
        """Workers that have something to tell, their death included; waits for the first."""
        seconds = None
        if self._setting.timeout is not None:
            seconds = min(1.0, self._setting.timeout / 4)
        wires: dict[Any, _Worker] = {worker.wire: worker for worker in self._workers}
        return [wires[wire] for wire in connections.wait(list(wires), seconds)]

    def _listen(self, worker: _Worker) -> Iterator[Outcome]:
        try:
            while worker.wire.poll():
                word, content = worker.wire.recv()
                worker.heard = max(worker.heard, time.monotonic())
                yield from self._take(worker, word, content)
        except (EOFError, OSError):
            yield from self._bury(worker, DIED)

    def _take(self, worker: _Worker, word: str, content: Any) -> Iterator[Outcome]:
        if word == "frames":
            worker.heard = time.monotonic()
            self._progress(*content)
        elif word == "outcome":
            worker.pending.discard((content.run, content.sequence))
            yield content
        elif word == "unfit":
            raise NatBenchError(content)
        else:  # ready for the next unit
            worker.is_ready, worker.unit = True, None
            self._false_starts = 0

    def _end_the_stuck(self) -> Iterator[Outcome]:
        limit = self._setting.timeout
        if limit is None:
            return
        for worker in list(self._workers):
            silent = time.monotonic() - worker.heard
            if worker.unit is not None and silent > limit + _GRACE_SECONDS:
                worker.process.kill()
                yield from self._bury(worker, f"one frame took longer than {limit:g} s")

    def _bury(self, worker: _Worker, reason: str) -> Iterator[Outcome]:
        """See to what a worker that is no more has left undone."""
        self._workers.remove(worker)
        worker.process.kill()
        worker.process.join()
        worker.wire.close()
        if worker.unit is None:
            self._false_starts += not worker.is_ready
            if self._false_starts >= _FALSE_STARTS:
                msg = f"worker processes die as they start ({_FALSE_STARTS} in a row)"
                raise NatBenchError(msg)
            return
        again, failed = sort_out(worker.unit, worker.pending, self._tries, self._setting.retries)
        self._waiting.extendleft(reversed(again))
        for run, name in failed:
            yield Outcome(run, name, reason=reason)


def sort_out(
    unit: Unit, pending: set[Job], tries: Counter[Job], retries: int
) -> tuple[list[Unit], list[Job]]:
    """What to do with jobs whose worker is gone: each again, by itself, or given up.

    Nobody knows which of several jobs took the worker down, so only one by itself is given up. A
    unit with sequences that may not have been begun is narrowed first, which counts for no job.

    Args:
        unit: what the worker was on.
        pending: jobs of it without an outcome.
        tries: how often a worker died over each job so far; one is added here.
        retries: how often a job is tried again.

    Returns:
        Smaller units, in the end of one job each, and the jobs that have been tried often enough.
    """
    if unit.refills:
        return unit.narrowed(pending), []
    tries.update(pending)
    failed = [job for job in pending if len(pending) == 1 and tries[job] > retries]
    return unit.singles(pending.difference(failed)), failed


def _runs(unit: Unit) -> frozenset[str]:
    return frozenset(one.run for one in unit.combinations)


def _devices(units: Sequence[Unit]) -> list[str]:
    """Devices that workers take in turn; empty text where trackers name their own."""
    if not any(c.device == "cuda" for unit in units for c in unit.combinations):
        return [""]
    import torch

    return [f"cuda:{number}" for number in range(torch.cuda.device_count())]


def _start(device: str, setting: Setting) -> _Worker:
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(
        target=_work, args=(theirs, setting, device), name="nat2024 worker", daemon=True
    )
    try:
        process.start()
    except OSError as error:
        msg = f"a worker process cannot be started ({error.strerror or error})"
        raise UsageError(msg) from None
    theirs.close()  # so that its end tells ours
    return _Worker(process, ours, device)


@contextlib.contextmanager
def born_deaf_to_interrupts() -> Iterator[None]:
    """Processes that are started here never hear Ctrl-C: stopping them is their parent's business.

    This thread holds it back meanwhile and does not ignore it, so that none is lost; where another
    thread hears it, it stops this one at once.
    """
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    resource_tracker.ensure_running()  # whose start would let Ctrl-C through again
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextlib.contextmanager
def _thread_variables(count: int) -> Generator[None]:
    """Libraries of linear algebra read these once, when a process loads them."""
    before = {name: os.environ.get(name) for name in _THREAD_VARIABLES}
    os.environ.update(dict.fromkeys(_THREAD_VARIABLES, str(count)))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def prepare_process(setting: Setting) -> None:
    """Fix the computing threads of this thread of this process, and load plugin files."""
    import cv2
    import torch

    keep_freed_memory()
    torch.set_num_threads(setting.threads)
    cv2.setNumThreads(setting.threads)
    for source in setting.plugins:
        load_plugin_file(source)


def stay_on(device: str) -> None:
    """Let what names no CUDA device take this one, so that the first is not crowded by all."""
    import torch

    torch.cuda.set_device(device)


def _work(wire: Connection, setting: Setting, device: str) -> None:
    """What a worker process does: units, one after another, until its parent ends it."""
    threading.Thread(target=_end_with_parent, daemon=True).start()
    if device:
        stay_on(device)
    try:
        prepare_process(setting)
    except NatBenchError as error:
        wire.send(("unfit", str(error)))
        return
    trackers = KeptTrackers()
    progress = Throttled(lambda *done: wire.send(("frames", done)), _TELL_SECONDS)
    with contextlib.suppress(EOFError, BrokenPipeError):  # there is nobody to work for any more
        while True:
            wire.send(("ready", None))
            unit = wire.recv()
            trackers.make_room(unit.combinations)
            for outcome in run_and_note_backends(unit, trackers, progress):
                progress.flush()
                wire.send(("outcome", outcome))


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
    os._exit(1)
