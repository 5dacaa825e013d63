"""What the tables of `growth.py` are made with: measurements in fresh processes, and Markdown."""

import functools
import json
import math
import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import growth_study
from side_by_side import shown

SCRIPT = Path(__file__).with_name("growth.py")
LIMIT = 180  # seconds for one measurement
SIZES = ((320, 180), (640, 360), (960, 540), (1280, 720), (1920, 1080), (3840, 2160))
STUDY_SLEEP, STUDY_FROM = 0.01, 4  # seconds a frame; fewer workers would take long
Row = dict[str, Any]


def form(value: float) -> str:
    """Three digits of what was measured, all of a count, a dash for what is not known."""
    if isinstance(value, int):
        return f"{value:,}"
    if math.isnan(value):
        return "-"
    digits = max(0, 2 - math.floor(math.log10(value))) if value > 0 else 0
    return shown(value, f",.{min(digits, 3)}f")


def table(header: str, rows: Sequence[Sequence[object]]) -> str:
    """In Markdown; columns whose title begins with a blank are text."""
    titles = header.split("|")
    lines = [" | ".join(["", *(title.strip() for title in titles), ""]).strip()]
    marks = ["---" if title.startswith(" ") else "---:" for title in titles]
    lines.append(" | ".join(["", *marks, ""]).strip())
    for row in rows:
        fields = [form(one) if isinstance(one, int | float) else str(one) for one in row]
        lines.append(" | ".join(["", *fields, ""]).strip())
    return "\n".join(lines)


class Bench:
    """Measurements, each made once; rows of those that failed answer NaN."""

    def __init__(self, folder: str) -> None:
        self.folder = folder
        self.rows: list[Row] = []

    @functools.cache  # noqa: B019  there is one bench, and it ends with the script
    def _measure(self, text: str) -> Row:
        command = [sys.executable, str(SCRIPT), "--job", text]
        environment = {**os.environ, "OMP_NUM_THREADS": "1"}
        try:
            done = subprocess.run(
                command,
                env=environment,
                capture_output=True,
                timeout=LIMIT,
                check=True,
                text=True,
            )
            answer: Row = json.loads(done.stdout)
        except (subprocess.SubprocessError, json.JSONDecodeError) as error:
            told = (getattr(error, "stderr", "") or "").strip().splitlines()[-1:]
            print(f"{text}: {type(error).__name__} {told}", file=sys.stderr)
            answer = {}
        self.rows.append({"job": json.loads(text), "measured": answer})
        return answer

    def measure(self, kind: str, **job: Any) -> "Measured":
        """What a job measures in a fresh process."""
        text = json.dumps({"kind": kind, "folder": self.folder, **job}, sort_keys=True)
        return Measured(self._measure(text))

    def run(self, **job: Any) -> "Measured":
        """A run over rendered frames, which are rendered before the first one."""
        self.measure("render", sizes=SIZES)
        return self.measure("run", **job)

    def cluster(self, threads: int) -> dict[str, "Measured"]:
        """Works of sleeping trackers on so many threaded workers."""
        works = {
            "few": {"lengths": [1] * 25, "sleep": 0.0},
            "many": {"lengths": [1] * 125, "sleep": 0.0},
            "fast": {"lengths": [200] * 2 * threads, "sleep": 0.005},
            "slow": {"lengths": [40] * 2 * threads, "sleep": 0.025},
            "study": {"lengths": small_study(), "sleep": STUDY_SLEEP},
        }
        if threads < STUDY_FROM:
            del works["study"]
        found = self.measure("cluster", threads=threads, works=works)
        return {name: Measured(found.get(name, {})) for name in (*works, "study")}


def small_study() -> list[int]:
    """The lengths of the study's sequences, a hundredth of each, the longest first."""
    studied = (n for name in growth_study.DATASETS for n in growth_study.lengths(name))
    return sorted((max(1, n // 100) for n in studied), reverse=True)


class Measured(dict[str, Any]):
    """Numbers by name; NaN where there is none."""

    def __missing__(self, _name: str) -> float:
        return math.nan


def unit_ms(few: Measured, many: Measured, kind: str) -> float:
    """Milliseconds that each further unit costs."""
    return float(1000 * (many[kind] - few[kind]) / (many["units"] - few["units"]))
