"""The benchmark of evaluation, on few and short sequences."""

import json
import subprocess
import sys
from pathlib import Path

import evaluate_speed
import numpy as np
import pytest
from peers import pysot_form

import nat2024

SCRIPT = Path(evaluate_speed.__file__)


@pytest.fixture
def kit(tmp_path: Path) -> Path:
    rng = np.random.default_rng(0)
    for name in ("a", "b"):
        truth = rng.integers(1, 60, (12, 4)).astype(float)
        nat2024.write_boxes(tmp_path / "anno" / f"{name}.txt", truth)
        for tracker in ("mil", "kcf"):
            boxes = truth + rng.integers(-5, 6, truth.shape)
            nat2024.write_boxes(tmp_path / "results" / tracker / f"{name}.txt", boxes)
    return tmp_path


def test_every_side_is_measured(kit: Path) -> None:
    command = [sys.executable, SCRIPT, kit, "--repeats", "1", "--json"]
    found = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    assert set(found) == {"best_s", "median_s", "times_as_fast", "bytes_a_tracker"}
    assert 2 * 8 * 137 < found["bytes_a_tracker"] < 50_000  # two sequences, and names
    assert set(found["median_s"]) == {
        *("pysot form", "curves"),
        *("evaluate, no cache", "evaluate, empty cache", "evaluate, from cache"),
    }
    assert found["times_as_fast"]["pysot form"] == [1, 1]


def test_unequal_curves_are_not_timed(kit: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    truths, results = evaluate_speed.load(kit)
    evaluate_speed.check_equal(truths, results)
    curves = pysot_form.curves
    monkeypatch.setattr(pysot_form, "curves", lambda *args: [one / 2 for one in curves(*args)])
    with pytest.raises(SystemExit, match="the curves differ"):
        evaluate_speed.check_equal(truths, results)


def test_growth(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NAT2024_CACHE", str(tmp_path / "cache"))
    rows = evaluate_speed.measure_growth(160, tmp_path)
    assert [row["files"] for row in rows] == [20, 40, 80, 160]
    assert all(row["new_ms"] > 0 and row["cached_ms"] > 0 for row in rows)
