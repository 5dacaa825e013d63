"""The script that measures how fast light labels are made."""

import json
import subprocess
import sys
from pathlib import Path

import label_speed
import pytest


def test_rates_follow_from_seconds():
    row = {
        "work": "labels",
        "threads": 2,
        "processor_ms": 40.0,
        "per_second_on_own_cores": 50.0,
        "per_second": 25.0,
        "cores_got": 1.0,
    }
    lines = label_speed.table_of([row]).splitlines()
    assert lines[2] == "| labels | 2 | 40.0 | 50 | 25 | 1.00 |"
    assert {line.count("|") for line in lines} == {7}


@pytest.mark.slow
def test_it_measures_both_and_updates_a_page(tmp_path):
    page = tmp_path / "page.md"
    page.write_text("before\n{}\n{}\nafter\n".format(*label_speed.MARKERS))
    words = ["--images", "2", "--repeats", "1", "--threads", "2", "--json", "--update", str(page)]
    command = [sys.executable, str(Path(label_speed.__file__)), *words]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    rows = json.loads(done.stdout)["rows"]
    assert [row["threads"] for row in rows] == [2, 2]
    for row in rows:
        assert row["per_second_on_own_cores"] == pytest.approx(2000 / row["processor_ms"])
        assert row["per_second"] > 0
    assert page.read_text().count("| labels") == 2
