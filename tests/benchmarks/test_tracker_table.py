import json
import subprocess
import sys
from pathlib import Path

import pytest
import tracker_table
from tracker_table import MARKERS, Measured, chosen_titles, header

SCRIPT = Path(tracker_table.__file__)


def test_a_row_has_a_field_for_each_column():
    result = Measured("mil", 3, (0.5, 0.25), 50.0)
    row = result.row(reference=100.0)
    assert row == "| `mil`, mean of 3 runs | 0.500 | 0.250 | **0.375** | 50 | 0.50 |"
    assert header(["a", "b"]).splitlines()[0].count("|") == row.count("|")


def test_lines_are_chosen_by_the_name_of_the_tracker():
    assert chosen_titles("opencv_nano,kcf") == ["kcf", "opencv_nano v1", "opencv_nano v2"]
    assert len(chosen_titles("")) == 12
    with pytest.raises(SystemExit, match="no such tracker; there are fdsst"):
        chosen_titles("kfc")


def run(*arguments):
    return subprocess.run(
        [sys.executable, str(SCRIPT), *arguments], capture_output=True, text=True, check=False
    )


@pytest.mark.slow
def test_it_measures_and_updates_a_page(night_clip, tmp_path):
    page = tmp_path / "page.md"
    page.write_text(f"before\n{MARKERS[0]}\nold\n{MARKERS[1]}\nafter\n")
    done = run(str(night_clip), "--only", "kcf,nanotrack", "--json", "--update", str(page))
    assert done.returncode == 0, done.stderr
    assert "nanotrack v1: left out, it needs --nanotrack" in done.stderr
    [row] = json.loads(done.stdout)["rows"]
    assert row["tracker"] == "kcf"
    assert len(row["success_auc"]) == 3
    assert row["mean"] == pytest.approx(sum(row["success_auc"]) / 3)
    text = page.read_text()
    assert "| tracker | narrow | tall | wide | mean |" in text
    assert f"| **{row['mean']:.3f}** |" in text
    assert "old" not in text


def test_a_folder_without_sequences_is_told_in_one_line(tmp_path):
    done = run(str(tmp_path))
    assert done.returncode == 1
    assert "Traceback" not in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
