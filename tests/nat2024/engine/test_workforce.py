"""Who works on a cluster: asked for rarely, and told where nobody can go on."""

import logging
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import nat2024
from nat2024.engine import cluster as dask_cluster
from nat2024.engine import combine, run_benchmark, workforce
from nat2024.engine.workforce import Workforce
from nat2024.errors import ClusterFailed

distributed = pytest.importorskip("distributed")
pytestmark = pytest.mark.usefixtures("small_plugins")


class Asked:
    """Stands for a client: tells of workers and counts how often it is asked."""

    def __init__(self, **workers: dict[str, Any]) -> None:
        self.workers, self.times = workers, 0

    def scheduler_info(self, n_workers: int) -> dict[str, Any]:
        self.times += 1
        return {
            "workers": dict(list(self.workers.items())[: n_workers if n_workers >= 0 else None])
        }


def worker(status: str = "running", threads: int = 1, **resources: float) -> dict[str, Any]:
    return {
        "status": status,
        "nthreads": threads,
        "resources": resources,
        "memory_limit": 400_000_000,
        "metrics": {"memory": 350_000_000},
    }


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """Its only number is the time."""
    now = [100.0]
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    return now


def test_the_scheduler_is_asked_once_a_second(clock: list[float]) -> None:
    client = Asked(a=worker())
    force = Workforce(client, needs_gpu=False)
    for _ in range(1000):
        clock[0] += 0.01
        force.look()
    assert client.times == pytest.approx(10, abs=1)
    assert force.room() == 1
    client.workers["b"] = worker(threads=4)
    clock[0] += 1.1
    force.look()
    assert force.room() == 5
    assert force.room(busy=["a", "b", ""]) == 2
    del client.workers["b"]
    clock[0] += 1.1
    force.look()
    assert force.room(busy=["a", "b"]) == -1  # its unit goes to who is left


def test_units_for_gpus_wait_for_who_has_one(clock: list[float]) -> None:
    client = Asked(a=worker(threads=4))
    force = Workforce(client, needs_gpu=True)
    force.look()
    assert (force.asks_for_gpus, force.room()) == (False, 4)  # nobody tells of any
    client.workers["b"] = worker(threads=4, GPU=2)
    clock[0] += 2
    force.look()
    assert (force.asks_for_gpus, force.room()) == (True, 2)
    del client.workers["b"]
    clock[0] += 2
    force.look()
    assert (force.asks_for_gpus, force.room()) == (True, 0)  # never on one without
    assert force.trouble()[1] == "none of 1 workers tells of a GPU any more; waiting for one"


def test_a_paused_worker_gets_nothing_and_ends_what_it_is_on(clock: list[float]) -> None:
    force = Workforce(Asked(a=worker("paused"), b=worker()), needs_gpu=False)
    force.look()
    assert force.room() == 1
    assert force.room(busy=["a"]) == 1
    assert force.room(busy=["a", "b"]) == 0


def test_what_lasts_is_told_once(clock: list[float], caplog: pytest.LogCaptureFixture) -> None:
    client = Asked(a=worker(), b=worker())
    force = Workforce(client, needs_gpu=False)

    def look(seconds: float) -> list[str]:
        caplog.clear()
        for _ in range(round(seconds)):
            clock[0] += 1.01
            force.look()
        return caplog.messages

    assert look(2) == []
    client.workers["a"] = worker("paused")
    assert look(2) == []  # memory may be freed at once
    [line] = look(20)
    assert line.startswith("1 of 2 workers are paused by Dask, which gives them nothing new: ")
    assert "they hold 350 MB of 400 MB each; start fewer workers" in line
    assert line.endswith("with a higher --memory-limit; Ctrl-C keeps what is finished")
    client.workers["b"] = worker("paused")
    assert [text[:20] for text in look(20)] == ["2 of 2 workers are p"]
    client.workers.clear()
    assert look(20) == ["no worker is there; waiting for one; Ctrl-C keeps what is finished"]
    client.workers["c"] = worker()
    assert look(5) == []
    client.workers.clear()
    assert len(look(20)) == 1


def test_missing_workers_are_started_anew(clock: list[float]) -> None:
    client, calls = Asked(a=worker()), []
    force = Workforce(client, needs_gpu=False, restore=lambda: calls.append(clock[0]))
    for count in (1, 2, 2, 1, 0, 2):
        client.workers = {str(number): worker() for number in range(count)}
        clock[0] += 2
        force.look()
    assert len(calls) == 2  # while there were fewer than before


@pytest.fixture
def threaded() -> Iterator[Any]:
    """A cluster of two workers in this process."""
    with distributed.LocalCluster(
        n_workers=2, processes=False, threads_per_worker=1, dashboard_address=":0", memory_limit=0
    ) as one:
        yield one


def test_a_job_whose_workers_are_all_paused_says_so_and_goes_on_when_they_can(
    threaded: Any,
    night_clip: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    from distributed.core import Status

    monkeypatch.setattr(workforce, "_LOOK_SECONDS", 0.05)
    monkeypatch.setattr(workforce, "_PATIENCE_SECONDS", 0.2)
    dataset, combinations = nat2024.load_dataset(night_clip), combine(["still"], ["none"])

    def set_status(status: Any) -> None:
        for one in threaded.workers.values():
            one.status = status

    def go_on() -> None:
        while not any("paused" in message for message in caplog.messages):
            time.sleep(0.02)
        threaded.loop.add_callback(set_status, Status.running)

    with distributed.Client(threaded) as client:
        threaded.sync(_later, set_status, Status.paused)
        helper = threading.Thread(target=go_on)
        helper.start()
        with caplog.at_level(logging.WARNING, logger="nat2024"):
            report = run_benchmark(combinations, dataset, tmp_path, cluster=client)
        helper.join()
    assert (report.tracked, report.failures) == (3, ())
    assert sum("2 of 2 workers are paused by Dask" in line for line in caplog.messages) == 1


async def _later(act: Any, *arguments: Any) -> None:
    act(*arguments)


def test_a_scheduler_that_goes_away_ends_the_job_with_a_line(
    threaded: Any, night_clip: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import dask

    monkeypatch.setattr(dask_cluster, "_CONNECT_SECONDS", 1)
    dataset, combinations = nat2024.load_dataset(night_clip), combine(["slow"], ["none"])

    def close(*_: object) -> None:
        if not closed:
            closed.append(True)
            threaded.close()

    closed: list[bool] = []
    with (
        dask.config.set({"distributed.comm.timeouts.connect": "1s"}),
        distributed.Client(threaded) as client,
        pytest.raises(ClusterFailed) as caught,
    ):
        run_benchmark(combinations, dataset, tmp_path, cluster=client, progress=close)
    assert "what was finished is kept" in str(caught.value)
