"""Tracking on a Dask cluster: the same bytes, written by the client, whatever workers do."""

import os
import random
import shutil
import signal
import stat
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec
import pytest
import torch

import nat2024
from nat2024.cli import run as nat_bench
from nat2024.engine import cluster as dask_cluster
from nat2024.engine import cluster_worker, combine, run_benchmark
from nat2024.engine.lockstep import Reading
from nat2024.engine.units import Trackers, Unit
from nat2024.errors import ClusterFailed, UsageError
from nat2024.store import DatasetRecord, RunFolder

distributed = pytest.importorskip("distributed")
pytestmark = pytest.mark.usefixtures("small_plugins")


@pytest.fixture(scope="module")
def client() -> Iterator[Any]:
    """A client of one worker process; a task that takes it down is told at once."""
    import dask

    settings = {
        "distributed.scheduler.allowed-failures": 0,
        # else a cluster gives a worker up that is away a while after it was killed, for good
        "distributed.deploy.lost-worker-timeout": "1h",
    }
    with (
        dask.config.set(settings),
        distributed.LocalCluster(
            n_workers=1, threads_per_worker=1, processes=True, dashboard_address=":0"
        ) as cluster,
        distributed.Client(cluster) as one,
    ):
        yield one


def box_files(results: Path) -> dict[str, bytes]:
    return {str(p.relative_to(results)): p.read_bytes() for p in sorted(results.rglob("*.txt"))}


def test_the_same_bytes_from_a_cluster(
    client: Any, night_clip: Path, tmp_path: Path, small_plugins: str
) -> None:
    dataset = nat2024.load_dataset(night_clip)
    combinations = combine(["still", "fails"], ["none", "clahe"])
    told: list[tuple[int, str]] = []
    report = run_benchmark(
        combinations,
        dataset,
        tmp_path / "cluster",
        cluster=client,
        plugins=(small_plugins,),
        progress=lambda *news: told.append(news),
    )
    assert {(f.run, f.sequence, f.reason) for f in report.failures} == {
        (run, "wide", "frame 5 of 8: ValueError: lost its mind") for run in ("fails", "fails+clahe")
    }
    assert report.tracked == 10
    run_benchmark(combinations, dataset, tmp_path / "here")
    assert box_files(tmp_path / "cluster") == box_files(tmp_path / "here")
    assert sum(frames for frames, _ in told) == 10 * 8 + 2 * 4
    manifest = RunFolder(report.folder / "still").manifest()
    assert manifest is not None
    assert manifest.sessions[0].cluster.startswith("tcp://")
    assert list(client.run(count_trackers).values()) == [0]  # others need the memory


def count_trackers() -> int:
    from nat2024.engine.cluster_worker import _campaigns

    assert _campaigns
    return sum(len(trackers._made) for trackers in _campaigns)


def test_workers_on_one_machine_take_its_devices_in_turn(
    night_clip: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    chosen: list[str] = []
    monkeypatch.setattr(torch.cuda, "device_count", lambda: 2)
    monkeypatch.setattr(torch.cuda, "set_device", chosen.append)
    combinations = combine(["still"], ["none"], device="cuda")
    unit = Unit(tuple(combinations), tuple(nat2024.load_dataset(night_clip)), Reading())
    for worker, device in ((0, "cuda:0"), (1, "cuda:1"), (2, "cuda:0"), ("named", "cuda")):
        [one] = cluster_worker._in_turn(unit, worker).combinations
        assert one.device == device
    assert chosen == ["cuda:0", "cuda:1", "cuda:0"]


def test_what_workers_lack_is_told_at_once(
    client: Any, night_clip: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    dataset = nat2024.load_dataset(night_clip)
    combinations = combine(["still"], ["none"])
    nowhere = str(tmp_path / "nowhere.py")
    with pytest.raises(ClusterFailed, match=r"worker tcp://.*nowhere\.py cannot be loaded"):
        run_benchmark(combinations, dataset, tmp_path / "a", cluster=client, plugins=(nowhere,))

    copy = tmp_path / "copy"
    shutil.copytree(night_clip, copy)
    gone = nat2024.load_dataset(copy)
    shutil.rmtree(copy / "data_seq" / "tall")
    plugins = (str(Path(__file__).parents[2] / "data" / "plugins" / "small.py"),)
    report = run_benchmark(combinations, gone, tmp_path / "b", cluster=client, plugins=plugins)
    assert [f.sequence for f in report.failures] == ["tall"]  # nobody has it: a bad sequence
    monkeypatch.setattr(dask_cluster, "first_frame_fault", lambda _: "")
    with pytest.raises(ClusterFailed, match="datasets must lie on every worker under the same"):
        run_benchmark(combinations, gone, tmp_path / "c", cluster=client, plugins=plugins)


def test_other_weights_or_options_on_a_worker_are_refused(night_clip: Path) -> None:
    from nat2024.engine.plan import describe

    [one] = combine(["still"], ["gamma"])
    wanted = describe(one, *one.create(), DatasetRecord("night_clip"), threads=1)
    unit = Unit((one,), tuple(nat2024.load_dataset(night_clip)), Reading())
    cluster_worker.check_fit(unit, Trackers(), {one.run: wanted})
    assert wanted.enhancer is not None
    other = msgspec.structs.replace(wanted.enhancer, options={"gamma": 0.25})
    expected = {one.run: msgspec.structs.replace(wanted, enhancer=other)}
    with pytest.raises(ClusterFailed, match=r"gamma\.gamma 0\.25 \(now 0\.5\)"):
        cluster_worker.check_fit(unit, Trackers(), expected)


def test_devices_are_those_of_workers(
    client: Any, night_clip: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if torch.cuda.is_available():
        pytest.skip("there is a CUDA device")
    dataset = nat2024.load_dataset(night_clip)
    with pytest.raises(ClusterFailed, match=r"worker tcp://.*: device 'cuda' is not there"):
        run_benchmark(
            combine(["mosse"], ["none"], device="cuda"), dataset, tmp_path / "a", cluster=client
        )
    monkeypatch.setattr(nat2024.interfaces.trackers, "check_device", lambda device: device)
    monkeypatch.setattr(torch.cuda, "synchronize", lambda _: None)
    chosen = combine(["still"], ["none"], device="cuda", backend="auto")
    with (
        distributed.LocalCluster(
            n_workers=1, processes=False, dashboard_address=":0", memory_limit=0
        ) as cluster,
        distributed.Client(cluster) as threads,
    ):
        report = run_benchmark(chosen, dataset, tmp_path / "b", cluster=threads)
    assert report.failures == ()
    manifest = RunFolder(report.folder / "still").manifest()
    assert manifest is not None
    assert manifest.device == "cuda"


def test_auto_is_torch_for_devices_that_are_elsewhere() -> None:
    from nat2024.engine.plan import in_torch_for_auto

    named = {"ldenhancer": {"backend": "onnxruntime"}}
    [one, other] = combine(
        ["siamrpnpp"], ["dcepp", "ldenhancer"], device="cuda", backend="auto", options=named
    )
    assert in_torch_for_auto(one).tracker.options["backend"] == "torch"
    for before, backend in ((one, "torch"), (other, "onnxruntime")):
        enhancer = in_torch_for_auto(before).enhancer
        assert enhancer is not None
        assert enhancer.options["backend"] == backend


def test_clusters_that_there_are_not(
    night_clip: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    dataset, combinations = nat2024.load_dataset(night_clip), combine(["still"], ["none"])
    monkeypatch.setattr(dask_cluster, "_CONNECT_SECONDS", 0.5)
    with pytest.raises(ClusterFailed, match="cannot be reached"):
        run_benchmark(combinations, dataset, tmp_path, cluster="tcp://127.0.0.1:9")
    with pytest.raises(UsageError, match="'moon' is none of local, slurm, tcp://HOST:PORT"):
        run_benchmark(combinations, dataset, tmp_path, cluster="moon")
    with pytest.raises(UsageError, match=r"jobqueue\.yaml"):
        run_benchmark(combinations, dataset, tmp_path, cluster="slurm")


PLUGIN = """
from nat2024 import Tracker, register_tracker
from nat2024.cards import Card

@register_tracker("fixed")
class Fixed(Tracker):
    card = Card(title="Fixed", summary="")

    def start(self, image, box):
        self.box = box
        return box

    def advance(self, image):
        return self.box, 0.0
"""


def test_the_command_line_with_relative_paths(
    client: Any,
    night_clip: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    shutil.copytree(night_clip, tmp_path / "clip")
    (tmp_path / "fixed.py").write_text(PLUGIN)
    monkeypatch.chdir(tmp_path)
    words = ["run", "--tracker", "fixed", "--plugin", "fixed.py", "--device", "cpu"]
    words += ["--dataset", "clip", "--cluster", client.scheduler.address]
    assert nat_bench(words) == 0
    assert f"cluster {client.scheduler.address}, dashboard" in capsys.readouterr().err
    assert len(box_files(tmp_path / "results")) == 3


def test_a_sequence_that_takes_workers_down_fails_alone(
    client: Any, night_clip: Path, tmp_path: Path, small_plugins: str
) -> None:
    report = run_benchmark(
        combine(["dies"], ["none"]),
        nat2024.load_dataset(night_clip).select(["tall", "wide"]),
        tmp_path,
        cluster=client,
        plugins=(small_plugins,),
        retries=0,
    )
    [failure] = report.failures
    assert (failure.run, failure.sequence) == ("dies", "wide")
    assert "worker process died" in failure.reason
    assert RunFolder(report.folder / "dies").finished() == ["tall"]


def kill_cluster_workers(
    client: Any, clip: Path, results: Path, small_plugins: str, *, times: int, seed: int
) -> None:
    """Kill the processes of workers at random moments; their nannies start new ones."""
    moments, over, killed = random.Random(seed), threading.Event(), []

    def kill() -> None:
        while len(killed) < times and not over.wait(moments.uniform(0.05, 0.5)):
            nannies = client.cluster.workers.values()
            victim = moments.choice([n.pid for n in nannies if n.pid] or [None])
            if victim and client.nthreads():  # Dask gives up a worker that dies as it starts
                os.kill(victim, signal.SIGKILL)
                killed.append(victim)
                over.wait(2)

    thread = threading.Thread(target=kill)
    thread.start()
    try:
        report = run_benchmark(
            combine(["slow"], ["none", "clahe"]),
            nat2024.load_dataset(clip),
            results,
            cluster=client,
            plugins=(small_plugins,),
            retries=1000,
        )
    finally:
        over.set()
        thread.join()
    assert killed
    assert report.failures == ()


def test_workers_of_a_cluster_are_killed(
    client: Any, night_clip: Path, tmp_path: Path, small_plugins: str
) -> None:
    kill_cluster_workers(client, night_clip, tmp_path / "a", small_plugins, times=1, seed=8)
    run_benchmark(
        combine(["slow"], ["none", "clahe"]), nat2024.load_dataset(night_clip), tmp_path / "b"
    )
    assert box_files(tmp_path / "a") == box_files(tmp_path / "b")
    assert not [p for p in (tmp_path / "a").rglob("*") if p.name.startswith(".")]


@pytest.mark.slow
def test_a_longer_soak(client: Any, night_clip: Path, tmp_path: Path, small_plugins: str) -> None:
    run_benchmark(
        combine(["slow"], ["none", "clahe"]), nat2024.load_dataset(night_clip), tmp_path / "b"
    )
    for seed in range(12):
        results = tmp_path / str(seed)
        kill_cluster_workers(client, night_clip, results, small_plugins, times=2, seed=seed)
        assert box_files(results) == box_files(tmp_path / "b")


@pytest.mark.slow
def test_a_worker_that_a_local_cluster_gives_up_is_replaced(
    night_clip: Path, tmp_path: Path, small_plugins: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    import dask

    made: list[Any] = []

    class Watched(distributed.LocalCluster):  # type: ignore[misc, name-defined]
        def __init__(self, **settings: Any) -> None:
            super().__init__(**settings)
            made.append(self)

    def kill() -> None:
        [worker] = made[0].workers.values()
        os.kill(worker.pid, signal.SIGKILL)

    def once(*_: object) -> None:
        if not killed:
            killed.append(kill())

    killed: list[None] = []
    monkeypatch.setattr(distributed, "LocalCluster", Watched)
    with dask.config.set({"distributed.deploy.lost-worker-timeout": "50ms"}):
        report = run_benchmark(
            combine(["slow"], ["none"]),
            nat2024.load_dataset(night_clip),
            tmp_path,
            cluster="local",
            plugins=(small_plugins,),
            progress=once,
        )
    assert killed
    assert (report.tracked, report.failures) == (3, ())


@pytest.mark.slow
def test_a_local_cluster_ends_with_who_started_it(
    night_clip: Path, tmp_path: Path, small_plugins: str
) -> None:
    words = ["run", "--tracker", "slow", "--dataset", str(night_clip), "--plugin", small_plugins]
    words += ["--results", str(tmp_path), "--cluster", "local", "--workers", "2", "-q"]
    process = subprocess.Popen(
        [sys.executable, "-m", "nat2024", *words], start_new_session=True, stdout=subprocess.DEVNULL
    )
    while process.poll() is None and not list((tmp_path / "night_clip").glob("*/*.txt")):
        time.sleep(0.01)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    deadline = time.monotonic() + 60
    while time.monotonic() < deadline and members(process.pid):
        time.sleep(0.1)
    assert not members(process.pid)
    assert subprocess.run([sys.executable, "-m", "nat2024", *words], check=False).returncode == 0
    assert len(box_files(tmp_path)) == 3


@pytest.mark.slow
def test_who_hangs_on_a_cluster_is_ended(
    client: Any,
    night_clip: Path,
    tmp_path: Path,
    small_plugins: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(dask_cluster, "_GRACE_SECONDS", 0.5)
    report = run_benchmark(
        combine(["hangs"], ["none"]),
        nat2024.load_dataset(night_clip),
        tmp_path,
        cluster=client,
        plugins=(small_plugins,),
        timeout=1,
        retries=0,
    )
    [failure] = report.failures
    assert (failure.sequence, failure.reason) == ("wide", "one frame took longer than 1 s")
    assert RunFolder(report.folder / "hangs").finished() == ["narrow", "tall"]


def members(session: int) -> list[int]:
    """Processes of a session that still run."""
    found = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = path.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if int(fields[3]) == session and fields[0] != "Z":
            found.append(int(path.parent.name))
    return found


SBATCH = """#!/bin/sh
cp "$1" {folder}/job.sh  # the original is removed as soon as this returns
nohup setsid sh {folder}/job.sh > {folder}/job.log 2>&1 < /dev/null &
echo "Submitted batch job $!"
"""
SCANCEL = """#!/bin/sh
for job in "$@"; do kill -TERM -- "-$job" 2> /dev/null; done
exit 0
"""


@pytest.mark.slow
def test_slurm(
    night_clip: Path, tmp_path: Path, small_plugins: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    import dask

    for name, text in (("sbatch", SBATCH.format(folder=tmp_path)), ("scancel", SCANCEL)):
        script = tmp_path / name
        script.write_text(text)
        script.chmod(script.stat().st_mode | stat.S_IEXEC)
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    job = {
        "cores": 1,
        "memory": "1GB",
        "python": sys.executable,
        "interface": "lo",
        "log-directory": None,
        "scheduler-options": {"dashboard_address": ":0"},
    }
    settings = {f"jobqueue.slurm.{key}": value for key, value in job.items()}
    with dask.config.set(settings):
        report = run_benchmark(
            combine(["still"], ["none"]),
            nat2024.load_dataset(night_clip),
            tmp_path / "results",
            cluster="slurm",
            plugins=(small_plugins,),
        )
    assert (report.tracked, report.failures) == (3, ())
