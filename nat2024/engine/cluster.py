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
from functools import partial
from typing import Any

from nat2024.engine.cluster_worker import Answer, Expected, first_frame_fault, forget, run_on_worker
from nat2024.engine.plan import PluginSpec
from nat2024.engine.units import Job, Outcome, Progress, Unit
from nat2024.engine.workers import DIED, Setting, born_deaf_to_interrupts, sort_out
from nat2024.engine.workforce import GPU, Client, Workforce
from nat2024.errors import ClusterFailed, UsageError
from nat2024.files import expand

log = logging.getLogger("nat2024")

_CONNECT_SECONDS = 30
_GRACE_SECONDS = 5.0
_STARTED = ("local", "slurm")  # by us
_LISTEN_SECONDS = 0.5  # then it is time to look who is there


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
        setting = replace(setting, plugins=plugins, in_turn=cluster == "local")
        work = list(map(_located, units))
        workforce = Workforce(
            client,
            needs_gpu=any(map(_needs_gpu, work)),
            restore=partial(_restore, client.cluster, workers) if cluster in _STARTED else None,
        )
        yield from _Campaign(client, work, expected, setting, progress, workforce).work()


def count_places(cluster: str | Client, workers: int) -> int:
    """How many units a cluster can work on at a time, as far as is known before it has begun.

    Args:
        cluster: as in `run_on_cluster`.
        workers: how many are asked for.

    Raises:
        ClusterFailed: there is nothing at its address.
    """
    if isinstance(cluster, str) and "://" not in cluster:
        return workers
    with contextlib.ExitStack() as stack:
        client = cluster if not isinstance(cluster, str) else _connect(cluster, workers, stack)
        threads: int = sum(client.nthreads().values())
        return max(workers, threads)


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
            n_workers=workers,
            threads_per_worker=1,
            dashboard_address=":0",
            memory_limit=0,  # as with --workers; a share of the machine's would pause them early
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


def _restore(cluster: Any, workers: int) -> None:
    """Start workers anew that a cluster of ours has given up, or whose job has ended."""
    if hasattr(cluster, "job_cls"):  # counts jobs apart from workers
        cluster.scale(jobs=workers)
    else:
        cluster.scale(workers)


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
        workforce: Workforce,
    ) -> None:
        self._client, self._expected, self._setting = client, dict(expected), setting
        self._progress = progress
        self._waiting = deque(units)
        self._tries: Counter[Job] = Counter()
        self._tasks: dict[str, _Task] = {}
        self._workforce = workforce
        self._news: queue.Queue[tuple[str, Any]] = queue.Queue()
        self._topic = f"nat-bench-{secrets.token_hex(6)}"

    def work(self) -> Iterator[Outcome]:
        """Run everything; what is still on its way is called off, however this ends."""
        self._client.subscribe_topic(self._topic, self._hear)
        try:
            while self._waiting or self._tasks:
                self._check_alive()
                self._workforce.look()
                self._submit()
                yield from self._listen()
                yield from self._end_the_stuck()
            with contextlib.suppress(Exception):  # a worker that goes now has nothing to forget
                self._client.run(forget, self._topic, on_error="ignore")
        finally:
            with contextlib.suppress(Exception):  # the cluster may be gone, and that told already
                self._client.cancel([task.future for task in self._tasks.values()])
                self._client.unsubscribe_topic(self._topic)

    def _hear(self, event: Any) -> None:
        self._news.put(("frames", event[1]))

    def _check_alive(self) -> None:
        if self._client.status not in ("running", "connecting"):
            msg = "the scheduler is gone; what was finished is kept, run the same command again"
            raise ClusterFailed(msg)

    def _submit(self) -> None:
        # one for each thread: what waited behind a unit that kills its worker would be blamed too
        room = self._workforce.room(task.worker for task in self._tasks.values())
        is_for_gpu = self._workforce.asks_for_gpus
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
                resources={GPU: 1} if is_for_gpu and _needs_gpu(unit) else None,
            )
            self._tasks[key] = _Task(unit, future)
            future.add_done_callback(self._done)

    def _done(self, future: Any) -> None:
        self._news.put(("done", future.key))

    def _listen(self) -> Iterator[Outcome]:
        """Take what has come in; answers that came together are fetched together."""
        ended: list[_Task] = []
        for word, content in self._take_news():
            if word == "done":
                if content in self._tasks:
                    ended.append(self._tasks.pop(content))
            elif task := self._tasks.get(content["key"]):
                task.worker, task.heard = content["worker"], time.monotonic()
                self._progress(content["frames"], content["what"])
        finished = [task for task in ended if task.future.status == "finished"]
        answers = dict(zip(finished, self._fetch(finished), strict=True))
        for task in ended:
            yield from self._settle(task, answers.get(task))

    def _take_news(self) -> Iterator[tuple[str, Any]]:
        """All news that there are; waits for the first."""
        with contextlib.suppress(queue.Empty):
            yield self._news.get(timeout=_LISTEN_SECONDS)
            while True:
                yield self._news.get_nowait()

    def _fetch(self, tasks: list[_Task]) -> "list[Answer | Exception]":
        try:
            return list(self._client.gather([task.future for task in tasks]))
        except Exception as error:  # a worker took answers with it, and died again over the work
            if len(tasks) == 1:
                return [error]
        return [one for task in tasks for one in self._fetch([task])]

    def _settle(self, task: _Task, answer: "Answer | Exception | None") -> Iterator[Outcome]:
        if isinstance(answer, Answer):
            yield from answer.outcomes
            if answer.unfit:
                yield from self._judge(task.unit, answer)
        elif task.future.status == "cancelled":
            self._check_alive()
            msg = "the scheduler has lost our work; what was finished is kept, run it again"
            raise ClusterFailed(msg)
        else:
            reason = _reason(answer or task.future.exception())
            yield from self._try_again(task.unit, reason)

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


def _needs_gpu(unit: Unit) -> bool:
    return any(one.device.startswith("cuda") for one in unit.combinations)


def _reason(error: BaseException | None) -> str:
    if type(error).__name__ == "KilledWorker":
        return DIED
    return f"its worker failed: {type(error).__name__}: {' '.join(str(error).split())}"
