"""A run that is killed goes on to the very same bytes."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest


def _command(clip: Path, results: Path) -> list[str]:
    words = ["run", "--tracker", "still", "--enhancer", "clahe", "--device", "cpu", "--quiet"]
    plugin = Path(__file__).parents[2] / "data" / "plugins" / "small.py"
    folders = ["--dataset", str(clip), "--results", str(results), "--plugin", str(plugin)]
    return [sys.executable, "-m", "nat2024", *words, *folders]


@pytest.mark.slow  # as in test_survival.py, whose processes need no start, by the command line
def test_killed_and_resumed_is_as_if_never_killed(tmp_path: Path) -> None:
    from nat2024.datasets import write_sequence
    from nat2024.night import Clip, render_clip

    clip = tmp_path / "clip"
    for number in range(6):
        settings = Clip(f"s{number}", frames=12, size=(160, 96), target_size=(16, 14), seed=number)
        write_sequence(clip, settings.name, render_clip(settings))
    whole = tmp_path / "whole"
    subprocess.run(_command(clip, whole), check=True, stdout=subprocess.DEVNULL)

    cut = tmp_path / "cut"
    folder = cut / "clip" / "still+clahe"
    process = subprocess.Popen(_command(clip, cut), stdout=subprocess.DEVNULL)
    while process.poll() is None and not list(folder.glob("s*.txt")):
        time.sleep(0.002)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    kept = {p.name: p.read_bytes() for p in folder.glob("s*.txt")}
    assert kept
    subprocess.run(_command(clip, cut), check=True, stdout=subprocess.DEVNULL)
    names = [f"s{number}.txt" for number in range(6)]
    assert all((folder / name).read_bytes() == content for name, content in kept.items())
    for name in names:
        assert (folder / name).read_bytes() == (whole / "clip/still+clahe" / name).read_bytes()
