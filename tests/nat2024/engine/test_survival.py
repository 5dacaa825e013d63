"""Killed, starved, damaged and crowded: results end as if nothing had happened."""

import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

import nat2024
from nat2024.engine import combine, run_benchmark
from nat2024.engine.plan import Combination
from nat2024.errors import NatBenchError, ResultConflict, WeightsMissing
from nat2024.store import RunFolder

PLUGIN = Path(__file__).parents[2] / "data" / "plugins" / "small.py"
LENGTHS = (3, 7, 12, 5, 9)

pytestmark = [
    pytest.mark.usefixtures("small_plugins"),
    pytest.mark.skipif(not hasattr(os, "fork"), reason="kills forked processes"),
]


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Five short sequences."""
    from nat2024.datasets import write_sequence
    from nat2024.night import Clip, render_clip

    folder = tmp_path_factory.mktemp("survival") / "clip"
    for number, frames in enumerate(LENGTHS):
        settings = Clip(
            f"s{number}", frames=frames, size=(96, 64), target_size=(12, 10), seed=number
        )
        write_sequence(folder, settings.name, render_clip(settings))
    return folder


def work(clip: Path, results: Path, **how: Any) -> Any:
    """Two combinations of a tracker that takes a few milliseconds a frame."""
    combinations = how.pop("combinations", None) or chosen()
    how.setdefault("plugins", (str(PLUGIN),))
    return run_benchmark(combinations, nat2024.load_dataset(clip), results, **how)


def chosen(tracker: str = "slow") -> list[Combination]:
    return combine([tracker], ["none", "clahe"])


def box_files(results: Path) -> dict[str, bytes]:
    return {str(p.relative_to(results)): p.read_bytes() for p in sorted(results.rglob("*.txt"))}


@pytest.fixture(scope="module")
def whole(clip: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """Box files of a run that nothing happened to."""
    from nat2024 import registry

    registry.load_plugin_file(str(PLUGIN))
    results = tmp_path_factory.mktemp("whole")
    assert work(clip, results).failures == ()
    return box_files(results)


def fork(task: Callable[[], Any]) -> int:
    """Do something in a process of its own, which has all imports already; gives its id."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # of threads, which stay behind
        process = os.fork()
    if process:
        return process
    status = 1
    try:
        os.setsid()
        task()
        status = 0
    except NatBenchError:
        status = 2
    finally:
        os._exit(status)


def status_of(process: int) -> int:
    return os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])


def check_whole(results: Path) -> None:
    """Times are there for all that has boxes: they are written first."""
    for run in results.glob("*/*"):
        folder = RunFolder(run)
        for sequence in folder.finished():
            assert len(folder.seconds(sequence)) == len(folder.boxes(sequence))


def check_clean(results: Path) -> None:
    """No half file, no lock, and whatever is there is whole."""
    assert not [p for p in results.rglob("*") if p.name.startswith(".")]
    for run in results.glob("*/*"):
        manifest = RunFolder(run).manifest()
        assert manifest is not None
        assert manifest.failures == {}
        assert manifest.timing is not None
        assert manifest.timing.frames == sum(LENGTHS)


def kill_main(
    clip: Path,
    results: Path,
    whole: dict[str, bytes],
    *,
    times: int,
    seed: int,
    longest: float = 0.35,
    **how: Any,
) -> None:
    """Kill the main process at random moments, from the start again where all is done."""
    moments = random.Random(seed)
    killed = some = 0
    for _ in range(times):
        if box_files(results) == whole:
            check_whole(results)
            shutil.rmtree(results)
        process = fork(lambda: work(clip, results, **how))
        while "workers" in how and is_running(process) and not box_files(results):
            time.sleep(0.01)  # or most would die before they have begun
        time.sleep(moments.uniform(0, longest))
        os.kill(process, signal.SIGKILL)
        killed += status_of(process) == -signal.SIGKILL
        there = box_files(results)
        assert there.items() <= whole.items()  # whole or absent
        some += 0 < len(there) < len(whole)
        check_nobody_left(process)
    assert killed > times // 3
    assert some  # or nothing was ever cut off in its middle
    work(clip, results, **how)
    check_whole(results)
    assert box_files(results) == whole
    check_clean(results)


def check_nobody_left(session: int) -> None:
    """Workers of a killed process end by themselves."""
    deadline = time.monotonic() + 20
    while (left := members(session)) and time.monotonic() < deadline:
        time.sleep(0.02)
    assert left == []


def is_running(process: int) -> bool:
    return process in members(process)


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


def test_the_main_process_is_killed_again_and_again(
    clip: Path, tmp_path: Path, whole: dict[str, bytes]
) -> None:
    kill_main(clip, tmp_path, whole, times=24, seed=8)


CLUSTER = """
import sys, distributed
if __name__ == "__main__":
    cluster = distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, dashboard_address=":0", memory_limit=0
    )
    print(cluster.scheduler_address, flush=True)
    sys.stdin.read()
"""


@pytest.fixture(scope="module")
def scheduler(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The address of a cluster in processes of its own, so that this one has no loop to fork."""
    pytest.importorskip("distributed")
    script = tmp_path_factory.mktemp("cluster") / "cluster.py"
    script.write_text(CLUSTER)
    process = subprocess.Popen(
        [sys.executable, str(script)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    )
    assert process.stdin is not None
    assert process.stdout is not None
    yield process.stdout.readline().strip()
    process.stdin.close()
    process.wait()
    process.stdout.close()


def test_the_main_process_is_killed_while_a_cluster_works(
    clip: Path, tmp_path: Path, whole: dict[str, bytes], scheduler: str
) -> None:
    kill_main(clip, tmp_path, whole, times=12, seed=8, longest=0.9, cluster=scheduler)


def kill_workers(
    clip: Path, results: Path, whole: dict[str, bytes], *, times: int, seed: int
) -> None:
    """Kill worker processes at random moments while their parent goes on."""
    import multiprocessing

    moments, over, killed = random.Random(seed), threading.Event(), []

    def kill() -> None:
        while len(killed) < times and not over.wait(moments.uniform(0.05, 0.4)):
            workers = multiprocessing.active_children()
            if workers:
                victim = moments.choice(workers)
                assert victim.pid is not None
                os.kill(victim.pid, signal.SIGKILL)
                killed.append(victim.pid)

    # a worker that is killed before it is ready costs a start, so kills leave time for some work
    thread = threading.Thread(target=kill)
    thread.start()
    try:
        report = work(clip, results, workers=2, retries=1000)
    finally:
        over.set()
        thread.join()
    assert killed
    assert report.failures == ()
    assert multiprocessing.active_children() == []
    assert box_files(results) == whole
    check_clean(results)


def test_workers_are_killed(clip: Path, tmp_path: Path, whole: dict[str, bytes]) -> None:
    kill_workers(clip, tmp_path, whole, times=3, seed=8)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_a_longer_soak(
    clip: Path, tmp_path: Path, whole: dict[str, bytes], scheduler: str, seed: int
) -> None:
    kill_main(clip, tmp_path / "main", whole, times=100, seed=seed)
    kill_main(clip, tmp_path / "dask", whole, times=40, seed=seed, longest=0.9, cluster=scheduler)
    kill_main(clip, tmp_path / "crew", whole, times=8, seed=seed, workers=2)
    for number in range(6):  # four at most each: workers that never come to work are a fault
        kill_workers(clip, tmp_path / str(number), whole, times=4, seed=10 * seed + number)


def test_writes_that_fail_cost_their_sequence_until_there_is_room(
    clip: Path, tmp_path: Path
) -> None:
    tracker = combine(["still"], ["none"])
    longer, results = tmp_path / "clip", tmp_path / "cut"
    repeat_frames(clip, longer, times=25)

    def starved() -> None:  # there is room for manifests and short box files
        resource.setrlimit(resource.RLIMIT_FSIZE, (5000, 5000))
        report = work(longer, results, combinations=tracker)
        assert 0 < len(report.failures) < len(LENGTHS)
        assert all("cannot be written (File too large)" in f.reason for f in report.failures)

    assert status_of(fork(starved)) == 0
    assert 0 < len(box_files(results)) < len(LENGTHS)
    assert not list(results.rglob("*.tmp"))
    work(longer, results, combinations=tracker)
    work(longer, tmp_path / "uncut", combinations=tracker)
    assert box_files(results) == box_files(tmp_path / "uncut")

    def nothing_fits() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (10, 10))
        work(clip, tmp_path / "none", combinations=tracker)

    assert status_of(fork(nothing_fits)) == 2
    assert not [p for p in (tmp_path / "none").rglob("*") if p.is_file()]


def repeat_frames(source: Path, target: Path, times: int) -> None:
    """The same sequences, each frame `times` times, as hard links."""
    for folder in (source / "data_seq").iterdir():
        (target / "data_seq" / folder.name).mkdir(parents=True)
        for number, frame in enumerate(sorted(folder.iterdir())):
            for again in range(times):
                name = f"{number * times + again:05d}{frame.suffix}"
                os.link(frame, target / "data_seq" / folder.name / name)
        rows = nat2024.read_boxes(source / "anno" / f"{folder.name}.txt")
        nat2024.write_boxes(target / "anno" / f"{folder.name}.txt", np.repeat(rows, times, axis=0))


def test_a_damaged_frame_is_mended_later(
    clip: Path, tmp_path: Path, whole: dict[str, bytes]
) -> None:
    copy = tmp_path / "clip"
    shutil.copytree(clip, copy)
    frame = copy / "data_seq" / "s2" / "00005.png"
    content = frame.read_bytes()
    frame.write_bytes(content[: len(content) // 2])
    report = work(copy, tmp_path / "results")
    assert {f.sequence for f in report.failures} == {"s2"}
    frame.write_bytes(content)
    assert work(copy, tmp_path / "results").tracked == 2
    assert box_files(tmp_path / "results") == whole


def test_a_checkpoint_is_gone_for_a_while(clip: Path, tmp_path: Path) -> None:
    torch.manual_seed(0)
    checkpoint = tmp_path / "model.pth"
    state = nat2024.create_enhancer("dcepp", weights=False).model.state_dict()  # type: ignore[attr-defined]
    torch.save(state, checkpoint)
    combinations = combine(["still"], ["dcepp"], weights={"dcepp": str(checkpoint)}, scope="frame")
    work(clip, tmp_path / "whole", combinations=combinations)
    results = tmp_path / "cut"
    work(clip, results, combinations=combinations)
    for name in ("s1", "s3"):
        (results / "clip" / "still+dcepp" / f"{name}.txt").unlink()
    before = box_files(results)
    content = checkpoint.read_bytes()
    checkpoint.unlink()
    with pytest.raises(WeightsMissing):
        work(clip, results, combinations=combinations)
    assert box_files(results) == before
    checkpoint.write_bytes(content)
    assert work(clip, results, combinations=combinations).tracked == 2
    assert box_files(results) == box_files(tmp_path / "whole")


def test_two_calls_on_one_folder_at_a_time(
    clip: Path, tmp_path: Path, whole: dict[str, bytes]
) -> None:
    processes = [fork(lambda: work(clip, tmp_path)) for _ in range(3)]
    assert [status_of(process) for process in processes] == [0, 0, 0]
    assert box_files(tmp_path) == whole
    check_clean(tmp_path)
    for run in ("slow", "slow+clahe"):
        manifest = RunFolder(tmp_path / "clip" / run).manifest()
        assert manifest is not None
        sessions = manifest.sessions
        assert len({session.process for session in sessions}) == len(sessions)
        assert 1 <= len(sessions) <= 3
        assert all(session.finished for session in sessions)


def test_two_calls_with_other_settings_never_mix(clip: Path, tmp_path: Path) -> None:
    processes = [fork(lambda: work(clip, tmp_path, threads=n)) for n in (1, 2)]  # noqa: B023
    assert sorted(status_of(process) for process in processes) == [0, 2]
    for run in ("slow", "slow+clahe"):
        manifest = RunFolder(tmp_path / "clip" / run).manifest()
        assert manifest is not None
        assert len(manifest.sessions) == 1


def test_who_changes_a_manifest_waits_for_who_does(tmp_path: Path) -> None:
    folder = RunFolder(tmp_path / "run")
    marks = tmp_path / "marks"

    def change(who: str) -> None:
        for _ in range(20):
            with RunFolder(tmp_path / "run").alone(), marks.open("a") as file:
                for letter in (who, who.upper()):
                    file.write(letter)
                    file.flush()
                    time.sleep(0.0005)

    processes = [fork(lambda: change(who)) for who in "abc"]  # noqa: B023
    assert [status_of(process) for process in processes] == [0, 0, 0]
    text = marks.read_text()
    assert len(text) == 120
    assert all(text[n].upper() == text[n + 1] for n in range(0, 120, 2))
    assert not list(folder.path.iterdir())  # the lock leaves nothing


def test_a_folder_made_before_an_option_existed_goes_on(clip: Path, tmp_path: Path) -> None:
    import json

    work(clip, tmp_path, combinations=combine(["still"], ["gamma"]))
    path = tmp_path / "clip" / "still+gamma" / "run.json"
    manifest = json.loads(path.read_text())
    del manifest["tracker"]["options"]["step"]
    del manifest["batch"]
    path.write_text(json.dumps(manifest))
    assert work(clip, tmp_path, combinations=combine(["still"], ["gamma"])).skipped == 5
    other = combine(["still"], ["gamma"], options={"still": {"step": 2}})
    with pytest.raises(ResultConflict, match=r"still\.step unset \(now 2\.0\)"):
        work(clip, tmp_path, combinations=other)
