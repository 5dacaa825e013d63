"""What the speed scripts share: turns, fresh processes, and the page they keep."""

import json
import math

import pytest
import side_by_side

BEGIN, END = MARKERS = ("<!-- begin -->", "<!-- end -->")


def test_the_table_is_replaced_between_its_markers():
    page = f"before\n{BEGIN}\nold\n{END}\nafter\n"
    once = side_by_side.update(page, "new", MARKERS)
    assert once == f"before\n{BEGIN}\nnew\n{END}\nafter\n"
    assert side_by_side.update(once, "new", MARKERS) == once


@pytest.mark.parametrize("page", ["", BEGIN, f"{END}\n{BEGIN}", f"{BEGIN}{BEGIN}{END}"])
def test_a_page_without_markers_is_refused(page):
    with pytest.raises(SystemExit, match="the page needs one line"):
        side_by_side.update(page, "new", MARKERS)


@pytest.mark.parametrize(("seconds", "rounds"), [(60, 4), (0, 1)])
def test_sides_take_turns_until_time_is_over(seconds, rounds):
    calls = []
    sides = {"peer": lambda: calls.append("peer"), "ours": lambda: calls.append("ours")}
    times = side_by_side.take_turns(sides, 3, seconds)
    assert calls == ["peer", "ours"] * rounds
    assert set(times) == {"peer", "ours"}
    assert all(0 <= value < 1000 for value in times.values())


def test_a_process_that_dies_leaves_no_number(tmp_path):
    script = tmp_path / "dies.py"
    script.write_text("raise SystemExit(3)")
    found = side_by_side.in_fresh_process(script, {}, threads=1, limit=60)
    assert list(found) == ["peer", "ours"]
    assert all(math.isnan(value) for value in found.values())


def test_a_process_is_told_its_job_and_its_threads(tmp_path):
    script = tmp_path / "job.py"
    script.write_text(
        "import json, os, sys\n"
        "job = json.loads(sys.argv[2])\n"
        "print(json.dumps({'peer': job['a'], 'ours': int(os.environ['OMP_NUM_THREADS'])}))\n"
    )
    found = side_by_side.in_fresh_process(script, {"a": 7}, threads=2, limit=60)
    assert found == {"peer": 7, "ours": 2}


def test_an_unknown_name_is_refused_with_those_known():
    assert side_by_side.chosen("", ["a", "b"], "tracker") == ["a", "b"]
    assert side_by_side.chosen("b", ["a", "b"], "tracker") == ["b"]
    with pytest.raises(SystemExit, match="no tracker with a plain form: c; known: a, b"):
        side_by_side.chosen("c", ["a", "b"], "tracker")


def test_the_report_has_the_table_in_the_page_and_null_for_what_is_missing(tmp_path, capsys):
    page = tmp_path / "page.md"
    page.write_text(f"{BEGIN}\n{END}\n")
    rows = [{"ms": math.nan}]
    side_by_side.report("| ms |", ["| - |"], rows, as_json=True, page=page, markers=MARKERS)
    answer = json.loads(capsys.readouterr().out)
    assert answer == {"machine": side_by_side.machine(), "rows": [{"ms": None}]}
    assert page.read_text().endswith(f"\n\n| ms |\n| - |\n{END}\n")
