"""A full frame in a fresh process: the attention matrix alone would take 2 GB."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parents[3] / "benchmarks" / "ldenhancer_memory.py"


@pytest.mark.slow
def test_a_full_frame_adds_less_than_800_mb():
    finished = subprocess.run(
        [sys.executable, str(SCRIPT)], capture_output=True, text=True, check=True
    )
    report = json.loads(finished.stdout)
    assert report["frame"] == "1920x1080"
    # A frame as float32 has 25 MB, so a smaller number would mean that nothing was measured.
    assert 25 < report["added_mb"] < 800
