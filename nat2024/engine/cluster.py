"""Units of work on a Dask cluster: a scheduler at some address, Slurm, or this machine.

The client alone writes results, so workers need no file system of results; datasets, weights and
plugin files must lie on every worker under the paths that the client names.
"""

import contextlib
import logging
import queue
import secrets
import time
from collections import Counter, deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

from nat2024.engine.cluster_worker import Answer, Expected, first_frame_fault, run_on_worker
from nat2024.engine.plan import PluginSpec
from nat2024.engine.units import Job, Outcome, Progress, Unit
from nat2024.engine.workers import DIED, Setting, born_deaf_to_interrupts, sort_out
from nat2024.errors import ClusterFailed, UsageError
from nat2024.files import expand

Client: TypeAlias = Any
"""A `distributed.Client`; most of that package is untyped."""

log = logging.getLogger("nat2024")

_CONNECT_SECONDS = 30
_GRACE_SECONDS = 5.0
_GPU = "GPU"  # the name of the resource that Dask's own pages use


def run_on_cluster(
    cluster: str | Client,
    units: Iterable[Unit],
    expected: Expected,
    workers: int,
    setting: Setting,
    progress: Progress,
) -> Iterator[Outcome]:
    """Run units on a cluster, the first units first.

    Args:
        cluster: "local", "slurm", the address of a scheduler, or a client.
        units: what to do.
        expected: manifests by run.
        workers: how many are asked for, where the cluster is started here.
        setting: what workers share.
        progress: told of frames as workers tell them.

    Raises:
        ClusterFailed: there is no such cluster, it is gone, or its workers cannot do the work.
        UsageError: the extra `cluster` is not installed.
    """
    with contextlib.ExitStack() as stack:
        client = cluster if not isinstance(cluster, str) else _connect(cluster, workers, stack)
        log.info("cluster %s, dashboard %s", client.scheduler.address, client.dashboard_link)
        plugins = tuple(map(_absolute, setting.plugins))
        setting, units = replace(setting, plugins=plugins), map(_located, units)
        yield from _Campaign(client, units, expected, setting, progress).work()


def _located(unit: Unit) -> Unit:
    """The same from any working folder: files of weights by their absolute paths."""
    combinations = tuple(
        replace(
            one,
            tracker=_with_absolute_weights(one.tracker),
            enhancer=one.enhancer and _with_absolute_weights(one.enhancer),
        )
        for one in unit.combinations
    )
    return replace(unit, combinations=combinations)


def _with_absolute_weights(spec: PluginSpec) -> PluginSpec:
    return replace(spec, weights=_absolute(spec.weights)) if spec.weights else spec


def _absolute(path: str) -> str:
    """An absolute path of what is here; anything else, such as the name of a module, as it is."""
    here = expand(path)
    return str(here.absolute()) if here.exists() else path


def _untyped(module: object) -> Any:
    return module


def _connect(cluster: str, workers: int, stack: contextlib.ExitStack) -> Client:
    try:
        import distributed
    except ImportError:
        msg = '--cluster needs Dask: pip install "nat-bench[cluster]"'
        raise UsageError(msg) from None
    try:
        with born_deaf_to_interrupts():
            address = _start(cluster, workers, stack)
        client = _untyped(distributed).Client(address, timeout=_CONNECT_SECONDS)
    except (OSError, TimeoutError, ValueError) as error:
        told = " ".join(str(error).split())
        msg = f"cluster {cluster}: cannot be reached ({told}); is its scheduler running?"
        raise ClusterFailed(msg) from None
    return stack.enter_context(client)


def _start(cluster: str, workers: int, stack: contextlib.ExitStack) -> Any:
    """The address of a cluster that runs, or one that is started here and ends with us."""
    if cluster == "local":
        import distributed

        local = _untyped(distributed).LocalCluster(
            n_workers=workers, threads_per_worker=1, dashboard_address=":0"
        )
        return stack.enter_context(local)
    if cluster == "slurm":
        return stack.enter_context(_slurm(workers))
    if "://" not in cluster:
        msg = f"cluster {cluster!r} is none of local, slurm, tcp://HOST:PORT"
        raise UsageError(msg)
    return cluster


def _slurm(workers: int) -> Any:
    try:
        import dask_jobqueue
    except ImportError:
        msg = '--cluster slurm needs dask-jobqueue: pip install "nat-bench[cluster]"'
        raise UsageError(msg) from None
    try:
        cluster = _untyped(dask_jobqueue).SLURMCluster()
    except (ValueError, TypeError) as error:
        told = " ".join(str(error).split())
        msg = (
            f"cluster slurm: {told}; cores, memory, queue and walltime of a job belong into "
            "~/.config/dask/jobqueue.yaml, see docs/scaling.md"
        )
        raise UsageError(msg) from None
    cluster.scale(jobs=workers)
    return cluster


@dataclass(slots=True, eq=False)
class _Task:
    """A unit that the scheduler has."""

    unit: Unit
    future: Any
    worker: str = ""
    heard: float = float("inf")


class _Campaign:
    """Units on their way through a cluster."""

    def __init__(
        self,
        client: Client,
        units: Iterable[Unit],
        expected: Expected,
        setting: Setting,
        progress: Progress,
    ) -> None:
        self._client, self._expected, self._setting = client, dict(expected), setting
        self._progress = progress
        self._waiting = deque(units)
        self._tries: Counter[Job] = Counter()
        self._tasks: dict[str, _Task] = {}
        self._is_deserted = False
        self._news: queue.Queue[tuple[str, Any]] = queue.Queue()
        self._topic = f"nat-bench-{secrets.token_hex(6)}"

    def work(self) -> Iterator[Outcome]:
        """Run everything; what is still on its way is called off, however this ends."""
        self._client.subscribe_topic(self._topic, self._hear)
        try:
            self._await_workers()
            while self._waiting or self._tasks:
                self._submit()
                yield from self._listen()
                yield from self._end_the_stuck()
        finally:
            with contextlib.suppress(Exception):  # the cluster may be gone, and that told already
                self._client.cancel([task.future for task in self._tasks.values()])
                self._client.unsubscribe_topic(self._topic)

    def _hear(self, event: Any) -> None:
        self._news.put(("frames", event[1]))

    def _await_workers(self) -> None:
        told = False
        while not self._threads():
            if not told:
                log.info("no worker yet; waiting for the first")
                told = True
            self._check_alive()
            time.sleep(0.5)

    def _threads(self) -> int:
        self._check_alive()
        return sum(self._client.nthreads().values())

    def _check_workers(self) -> None:
        """Say once that no worker is left: others may come, but nobody should wait unknowingly."""
        if self._threads():
            self._is_deserted = False
        elif not self._is_deserted:
            self._is_deserted = True
            log.warning("no worker is left; waiting for one, Ctrl-C keeps what is finished")

    def _check_alive(self) -> None:
        if self._client.status not in ("running", "connecting"):
            msg = "the scheduler is gone; what was finished is kept, run the same command again"
            raise ClusterFailed(msg)

    def _submit(self) -> None:
        if not self._waiting:
            return
        # one for each thread: what waited behind a unit that kills its worker would be blamed too
        room = max(1, self._threads()) - len(self._tasks)
        while self._waiting and room > 0:
            unit, room = self._waiting.popleft(), room - 1
            key = f"{self._topic}-{secrets.token_hex(4)}"
            expected = {c.run: self._expected[c.run] for c in unit.combinations}
            future: Any = self._client.submit(
                run_on_worker,
                unit,
                expected,
                self._setting,
                self._topic,
                key,
                key=key,
                pure=False,
                resources={_GPU: 1} if self._needs_gpu(unit) else None,
            )
            self._tasks[key] = _Task(unit, future)
            future.add_done_callback(self._done)

    def _needs_gpu(self, unit: Unit) -> bool:
        """Whether it waits for a worker with a GPU; where none tells of any, all may have one."""
        if not any(c.device.startswith("cuda") for c in unit.combinations):
            return False
        workers = self._client.scheduler_info(n_workers=-1)["workers"].values()
        return any(_GPU in worker["resources"] for worker in workers)

    def _done(self, future: Any) -> None:
        self._news.put(("done", future.key))

    def _listen(self) -> Iterator[Outcome]:
        try:
            word, content = self._news.get(timeout=1.0)
        except queue.Empty:
            self._check_workers()
            return
        if word == "frames":
            task = self._tasks.get(content["key"])
            if task:
                task.worker, task.heard = content["worker"], time.monotonic()
                self._progress(content["frames"], content["what"])
        elif content in self._tasks:
            yield from self._settle(self._tasks.pop(content))

    def _settle(self, task: _Task) -> Iterator[Outcome]:
        if task.future.status == "finished":
            answer = task.future.result()
            yield from answer.outcomes
            if answer.unfit:
                yield from self._judge(task.unit, answer)
        elif task.future.status == "cancelled":
            self._check_alive()
            msg = "the scheduler has lost our work; what was finished is kept, run it again"
            raise ClusterFailed(msg)
        else:
            yield from self._try_again(task.unit, _reason(task.future.exception()))

    def _judge(self, unit: Unit, answer: Answer) -> Iterator[Outcome]:
        """A worker lacks something. Where the client has it, the cluster is not fit for this."""
        faults = {s.name: first_frame_fault(s) for s in unit.sequences}
        if not answer.is_without_frames or not any(faults.values()):
            raise ClusterFailed(answer.unfit)
        for run, name in unit.jobs:
            if faults[name]:
                yield Outcome(run, name, reason=faults[name])
        self._waiting.extendleft(unit.singles({job for job in unit.jobs if not faults[job[1]]}))

    def _try_again(self, unit: Unit, reason: str) -> Iterator[Outcome]:
        retries = self._setting.retries
        again, failed = sort_out(unit, set(unit.jobs), self._tries, retries)
        self._waiting.extendleft(reversed(again))
        for run, name in failed:
            yield Outcome(run, name, reason=reason)

    def _end_the_stuck(self) -> Iterator[Outcome]:
        limit = self._setting.timeout
        if limit is None:
            return
        for key, task in list(self._tasks.items()):
            if time.monotonic() - task.heard > limit + _GRACE_SECONDS:
                del self._tasks[key]
                self._client.cancel([task.future], force=True)
                try:
                    self._client.restart_workers([task.worker], timeout=_CONNECT_SECONDS)
                except Exception as error:  # no nanny that could, or gone by itself
                    log.warning("worker %s cannot be restarted: %s", task.worker, error)
                yield from self._try_again(task.unit, f"one frame took longer than {limit:g} s")


def _reason(error: BaseException | None) -> str:
    if type(error).__name__ == "KilledWorker":
        return DIED
    return f"its worker failed: {type(error).__name__}: {' '.join(str(error).split())}"
