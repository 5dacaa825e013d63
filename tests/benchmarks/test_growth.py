"""The script behind docs/growth.md: its arithmetic, its tables, and one real measurement."""

import json
import math
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import growth
import growth_bench
import growth_jobs
import growth_study
import pytest
from growth_study import Machine, Rates

from nat2024.registry import load_plugin

RATES = Rates(100.0, 10.0, 0.5, 10.0, 5.0, 0.0)


def test_the_study_is_that_of_the_issue():
    assert len(growth_study.combinations()) == 5 * 11
    assert sum(len(growth_study.lengths(name)) for name in growth_study.DATASETS) == 135 + 40
    assert growth_study.tracked_frames() == 55 * (125_466 + 74_315)
    assert growth_study.results_of_study() == 55 * 175


def test_units_go_to_the_first_free_worker():
    assert growth_study.carry_out([3, 2, 2], 2) == 4
    assert growth_study.carry_out([5, 1, 1], 2) == 5
    assert growth_study.carry_out([1.0] * 4, 4, [0.5] * 4) == pytest.approx(3.0)


def test_one_worker_takes_as_long_as_all_frames_take():
    seen = growth_study.forecast(Machine("core", 1, 10.0), RATES)
    assert seen.seconds == pytest.approx(growth_study.tracked_frames() / 10)
    assert seen.busy == pytest.approx(1)
    assert seen.together == pytest.approx(11)  # 55 combinations in five parts of 12 at most


def test_more_workers_are_faster_and_less_busy():
    seen = [growth_study.forecast(Machine("GPU", n, 400.0), RATES) for n in (1, 8, 64, 512)]
    assert [one.seconds for one in seen] == sorted((one.seconds for one in seen), reverse=True)
    assert [one.busy for one in seen] == sorted((one.busy for one in seen), reverse=True)
    longest = max(growth_study.lengths("uavdark135")) + max(growth_study.lengths("nat2024_2"))
    assert seen[-1].seconds > longest / 400


def test_a_batch_that_is_not_full_costs_more_than_its_frames():
    [unit, *_] = growth_study.plan("nat2024_2", 8, 8)
    assert unit.frames < growth_study.forwards(unit, 8) < 8 * unit.frames
    [alone, *_] = growth_study.plan("nat2024_2", 8, 1)
    assert growth_study.forwards(alone, 1) == pytest.approx(alone.frames)


def test_limits_come_in_their_order():
    found = growth_study.limits(Machine("GPU", 8, 400.0), RATES, 16, 1000)
    assert [one.workers for one in found] == sorted(one.workers for one in found)
    slow = growth_study.limits(Machine("GPU", 8, 400.0), RATES, 16, 100)
    storage = [next(one for one in some if "storage" in one.what) for some in (found, slow)]
    assert storage[0].workers == pytest.approx(10 * storage[1].workers)


def test_one_enhancer_is_most_of_the_arithmetic():
    some = [name for name in growth_study.ENHANCERS if name != "kindpp"]
    assert growth_study.dearness(growth_study.ENHANCERS) > 3 * growth_study.dearness(some) > 0


def test_names_of_the_study_are_plugins():
    for name in growth_study.TRACKERS:
        assert load_plugin(name, "tracker").card
    for name in growth_study.ENHANCERS:
        assert load_plugin(name, "enhancer").card


def test_tables_have_a_field_for_each_title():
    text = growth.table(" name|number", [("a", 1234.5), ("b", math.nan), ("c", 0.01234)])
    assert text.splitlines() == [
        "| name | number |",
        "| --- | ---: |",
        "| a | 1,234 |",
        "| b | - |",
        "| c | 0.012 |",
    ]


def test_the_target_never_jumps():
    order = growth_jobs.to_and_fro(60)
    assert {abs(a - b) for a, b in pairwise(order)} == {1}
    assert set(order) == set(range(growth_jobs.RENDERED))


def test_a_gpu_is_named_with_its_rate():
    assert growth.gpu("H100=812.5x16") == Machine("H100", 1, 812.5, 16)
    assert growth.gpu("any=100") == Machine("any", 1, 100.0, 1)
    for wrong in ("100", "any=fast", "any=0", "any=10x0"):
        with pytest.raises(SystemExit, match="NAME=FRAMES_PER_SECOND"):
            growth.gpu(wrong)


def test_a_measurement_that_fails_is_a_dash(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(growth_bench, "LIMIT", 0.01)
    bench = growth.Bench(str(tmp_path))
    assert growth.batches(bench).splitlines()[-1] == "| 4 | - | - | - |"
    assert "TimeoutExpired" in capsys.readouterr().err
    assert growth.rates(bench) == growth.UNKNOWN


def test_every_table_has_its_place_in_the_page():
    page = (Path(growth.__file__).parents[1] / "docs" / "growth.md").read_text()
    for name in growth.NAMES:
        for mark in growth.markers(name):
            assert page.count(mark) == 1, mark


def run(*words):
    command = [sys.executable, growth.__file__, *words]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_wrong_words_are_told_in_one_line():
    for words in (["--only", "nothing"], ["--gpu", "fast"]):
        done = run(*words)
        assert done.returncode == 1
        assert len(done.stderr.strip().splitlines()) == 1


@pytest.mark.slow
def test_it_measures_and_updates_a_page(tmp_path):
    page = tmp_path / "page.md"
    page.write_text("before\n{}\nold\n{}\nafter\n".format(*growth.markers("batches")))
    done = run("--only", "batches", "--json", "--update", str(page))
    assert done.returncode == 0, done.stderr
    measured = [row["measured"] for row in json.loads(done.stdout)["rows"]]
    assert all(row["tracked"] == 32 and row["peak_mb"] > 100 for row in measured[1:])
    text = page.read_text()
    assert "| batch | ms a frame |" in text
    assert "old" not in text


@pytest.mark.slow
def test_sleeping_trackers_speed_up_on_a_cluster():
    works = {"w": {"lengths": [40] * 8, "sleep": 0.01}}
    job = {"kind": "cluster", "folder": "", "threads": 4, "works": works}
    done = run("--job", json.dumps(job))
    assert done.returncode == 0, done.stderr
    seen = json.loads(done.stdout)["w"]
    assert seen["longest_seconds"] < seen["seconds"] < seen["asleep_seconds"]
