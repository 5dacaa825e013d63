"""Worker processes: whatever happens to one of them, the work is done and nobody is left behind."""

import os
import signal
import time
from pathlib import Path
from typing import Any

import pytest

import nat2024
from nat2024.engine import combine, kept_trackers, run_benchmark
from nat2024.engine import workers as crew
from nat2024.engine.kept_trackers import KeptTrackers
from nat2024.engine.lockstep import Reading
from nat2024.engine.plan import Combination, PluginSpec
from nat2024.engine.units import Unit
from nat2024.errors import BrokenPlugin, NatBenchError, UsageError
from nat2024.store import RunFolder

pytestmark = pytest.mark.usefixtures("small_plugins")


def test_who_hangs_is_ended_and_the_others_go_on(
    night_clip: Path, tmp_path: Path, small_plugins: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(crew, "_GRACE_SECONDS", 0.2)
    begun = time.monotonic()
    report = run_benchmark(
        combine(["hangs"], ["none"]),
        nat2024.load_dataset(night_clip),
        tmp_path / "results",
        timeout=1,
        retries=0,
        plugins=(small_plugins,),
    )
    assert time.monotonic() - begun < 60
    [failure] = report.failures
    assert (failure.sequence, failure.reason) == ("wide", "one frame took longer than 1 s")
    folder = RunFolder(report.folder / "hangs")
    assert folder.finished() == ["narrow", "tall"]
    manifest = folder.manifest()
    assert manifest is not None
    assert manifest.failures == {"wide": failure.reason}


def test_workers_that_cannot_load_a_plugin_say_so(night_clip: Path, tmp_path: Path) -> None:
    broken = tmp_path / "broken.py"
    broken.write_text("raise ValueError('not today')")
    dataset = nat2024.load_dataset(night_clip)
    with pytest.raises(NatBenchError, match=r"broken\.py cannot be loaded: ValueError: not today"):
        run_benchmark(
            combine(["still"], ["none"]), dataset, tmp_path, timeout=9, plugins=(str(broken),)
        )
    with pytest.raises(BrokenPlugin):
        nat2024.registry.load_plugin_file(str(broken))


def test_sorting_out_what_a_worker_left(night_clip: Path) -> None:
    from collections import Counter

    sequences = tuple(nat2024.load_dataset(night_clip))
    combinations = (Combination(PluginSpec("a"), None), Combination(PluginSpec("b"), None))
    unit = Unit(combinations, sequences, Reading(), lanes=len(sequences))
    tries: Counter[Any] = Counter()
    pending = {("a", "wide"), ("b", "tall")}
    again, failed = crew.sort_out(unit, pending, tries, retries=0)
    assert sorted(one.jobs for one in again) == [[("a", "wide")], [("b", "tall")]]
    assert failed == []  # it may have been the other one
    assert crew.sort_out(again[0], set(again[0].jobs), tries, retries=2)[1] == []
    again, failed = crew.sort_out(again[0], set(again[0].jobs), tries, retries=2)
    assert (again, len(failed)) == ([], 1)


def test_each_worker_has_a_device_of_its_own(
    night_clip: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import torch

    monkeypatch.setattr(torch.cuda, "device_count", lambda: 2)
    sequences = tuple(nat2024.load_dataset(night_clip))
    some, one = (
        Combination(PluginSpec("a"), None, "cuda"),
        Combination(PluginSpec("b"), None, "cpu"),
    )
    unit = Unit((some, one), sequences, Reading())
    assert crew._devices([unit]) == ["cuda:0", "cuda:1"]
    assert [c.device for c in unit.on_device("cuda:1").combinations] == ["cuda:1", "cpu"]
    assert crew._devices([Unit((one,), sequences, Reading())]) == [""]


def units_of(runs: list[str], sequences: Any) -> list[Unit]:
    return [
        Unit((Combination(PluginSpec("still", label=run), None),), (sequence,), Reading())
        for sequence in sequences
        for run in runs
    ]


def test_a_worker_gets_near_units_for_the_trackers_that_it_has(night_clip: Path) -> None:
    sequences = tuple(nat2024.load_dataset(night_clip))

    def taken(count: int) -> list[str]:
        units = units_of([f"r{number:02}" for number in range(count)], sequences)
        one = crew._Crew(units, 1, crew.Setting(), lambda *_: None)
        worker = crew._Worker(None, None, "")  # type: ignore[arg-type]
        order = []
        for _ in units:
            unit = one._take_unit(worker)
            worker.runs = crew._runs(unit)
            order.append(f"{unit.combinations[0].tracker.label} {unit.sequences[0].name}")
        assert sorted(order) == sorted(
            f"{u.combinations[0].tracker.label} {u.sequences[0].name}" for u in units
        )
        return order

    assert taken(2)[:2] == ["r00 narrow", "r01 narrow"]  # all trackers are kept: the first first
    assert taken(20)[:4] == ["r00 narrow", "r00 tall", "r01 narrow", "r01 tall"]


def test_a_worker_keeps_the_trackers_of_its_last_units() -> None:
    chosen = combine(["still", "still@b"], ["invert", "gamma"])
    kept = KeptTrackers(most=3)
    for one in chosen[:3]:
        kept.make_room([one])
        kept.get(one)
    first = kept.get(chosen[0])
    kept.make_room([chosen[0]])
    assert kept.get(chosen[0]) is first
    kept.make_room([chosen[3]])  # the second was used longest ago, and its enhancer with it
    kept.get(chosen[3])
    assert [kept.has(one) for one in chosen] == [True, False, True, True]
    assert set(kept._enhancers) == {"invert", "gamma"}
    kept.make_room(chosen[:1])
    kept.make_room([chosen[1], chosen[3]])
    kept.get(chosen[1])
    assert [kept.has(one) for one in chosen] == [True, True, False, True]
    wide = KeptTrackers(most=1)
    wide.make_room(chosen)
    assert all(wide.get(one) for one in chosen)
    wide.make_room(chosen)
    assert all(map(wide.has, chosen))  # one unit may need more than are kept else
    wide.make_room(chosen[3:])
    assert [wide.has(one) for one in chosen] == [False, False, False, True]
    assert set(wide._enhancers) == {"gamma"}


def test_memory_is_returned_where_networks_were_kept(monkeypatch: Any) -> None:
    returned: list[bool] = []
    monkeypatch.setattr(kept_trackers, "_return_memory", lambda: returned.append(True))
    for tracker, count in (("still", 0), ("siamrpnpp", 1)):
        kept = KeptTrackers()
        [chosen] = combine([tracker], ["none"])
        kept.make_room([chosen])
        kept.get(chosen)
        kept.clear()
        assert not kept.has(chosen)
        assert len(returned) == count


def test_threads_of_linear_algebra_are_set_for_workers_only(monkeypatch: Any) -> None:
    monkeypatch.setenv("OMP_NUM_THREADS", "7")
    monkeypatch.delenv("MKL_NUM_THREADS", raising=False)
    with crew._thread_variables(2):
        assert os.environ["OMP_NUM_THREADS"] == os.environ["MKL_NUM_THREADS"] == "2"
    assert os.environ["OMP_NUM_THREADS"] == "7"
    assert "MKL_NUM_THREADS" not in os.environ


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"batch": 0}, "batch must be at least 1, not 0"),
        ({"retries": -1}, "retries must be 0 or more, not -1"),
        ({"timeout": 0}, "timeout must be above 0 seconds, not 0"),
    ],
)
def test_impossible_numbers(
    night_clip: Path, tmp_path: Path, settings: dict[str, Any], message: str
) -> None:
    dataset = nat2024.load_dataset(night_clip)
    with pytest.raises(UsageError, match=message):
        run_benchmark(combine(["still"], ["none"]), dataset, tmp_path, **settings)
    assert not list(tmp_path.iterdir())


def test_workers_end_with_their_parent(
    night_clip: Path, tmp_path: Path, small_plugins: str
) -> None:
    import subprocess
    import sys

    words = ["run", "--tracker", "hangs", "--plugin", small_plugins, "--device", "cpu", "-q"]
    words += ["--dataset", str(night_clip), "--results", str(tmp_path), "--timeout", "600"]
    process = subprocess.Popen([sys.executable, "-m", "nat2024", *words])
    while process.poll() is None and len(list((tmp_path / "night_clip").glob("*/*.txt"))) < 2:
        time.sleep(0.02)
    children = descendants(process.pid)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    assert children
    deadline = time.monotonic() + 20
    while any(map(is_running, children)) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not any(map(is_running, children))


def descendants(process: int) -> list[int]:
    """Processes below one, by the parents that /proc tells."""
    parents = {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = stat.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        parents[int(stat.parent.name)] = int(fields[1])
    found, waiting = [], [process]
    while waiting:
        below = [child for child, parent in parents.items() if parent == waiting[0]]
        waiting = waiting[1:] + below
        found += below
    return found


def is_running(process: int) -> bool:
    try:
        state = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return False
    return state != "Z"
