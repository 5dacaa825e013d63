"""Tracking on a Dask cluster: the same bytes, written by the client, whatever workers do."""

import os
import shutil
import stat
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec
import pytest

import nat2024
from nat2024.engine import cluster as dask_cluster
from nat2024.engine import combine, run_benchmark
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
    }
    with (
        dask.config.set(settings),
        distributed.LocalCluster(
            n_workers=1, threads_per_worker=1, processes=True, dashboard_address=None
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
    monkeypatch.setattr(dask_cluster, "_first_frame_fault", lambda _: "")
    with pytest.raises(ClusterFailed, match="datasets must lie on every worker under the same"):
        run_benchmark(combinations, gone, tmp_path / "c", cluster=client, plugins=plugins)


def test_other_weights_or_options_on_a_worker_are_refused(night_clip: Path) -> None:
    from nat2024.engine.plan import describe

    [one] = combine(["still"], ["gamma"])
    wanted = describe(one, *one.create(), DatasetRecord("night_clip"), threads=1)
    unit = Unit((one,), tuple(nat2024.load_dataset(night_clip)), Reading())
    dask_cluster._check_fit(unit, Trackers(), {one.run: wanted})
    assert wanted.enhancer is not None
    other = msgspec.structs.replace(wanted.enhancer, options={"gamma": 0.25})
    expected = {one.run: msgspec.structs.replace(wanted, enhancer=other)}
    with pytest.raises(ClusterFailed, match=r"gamma\.gamma 0\.25 \(now 0\.5\)"):
        dask_cluster._check_fit(unit, Trackers(), expected)


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


SBATCH = """#!/bin/sh
nohup setsid sh "$1" > "$1.log" 2>&1 < /dev/null &
echo $! > {folder}/job.pid
echo "Submitted batch job $!"
"""
SCANCEL = """#!/bin/sh
for job in "$@"; do kill -TERM -- "-$job" 2> /dev/null; done
exit 0
"""


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
