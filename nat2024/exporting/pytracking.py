"""`tracking_results/TRACKER/PARAM/SEQ.txt`, tabs and whole numbers, `SEQ_time.txt`: pytracking."""

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from nat2024.exporting.taking import TakenRun
from nat2024.files import write_atomic
from nat2024.store import DatasetRecord
from nat2024.types import Boxes

WORDS = "tracking_results/TRACKER/PARAM/SEQUENCE.txt, SEQUENCE_time.txt"
LOSES = "boxes are cut to whole pixels, as that toolkit writes them"

_DEFAULT = "default"


def why_refused(boxes: Boxes) -> str:
    """Why boxes cannot be whole numbers, or an empty text."""
    bad = int((~np.isfinite(boxes).all(axis=1)).sum())
    return f"{bad} rows are not finite, and this layout has whole numbers only" if bad else ""


def write(runs: Sequence[TakenRun], dataset: DatasetRecord, out: Path) -> dict[str, Path]:  # noqa: ARG001
    """Write runs of a dataset; gives the folder of each."""
    folders = _folders(runs, out / "tracking_results")
    for run in runs:
        for sequence, boxes in run.boxes.items():
            folder = folders[run.name]
            rows = ("\t".join(str(int(value)) for value in row) for row in boxes.tolist())
            seconds = run.seconds.get(sequence)
            if seconds is not None:
                lines = "".join(f"{value:f}\n" for value in seconds.tolist())
                write_atomic(folder / f"{sequence}_time.txt", lines)
            write_atomic(folder / f"{sequence}.txt", "\n".join([*rows, ""]))
    return folders


def _folders(runs: Sequence[TakenRun], out: Path) -> dict[str, Path]:
    """TRACKER/PARAM of each run; runs that are called alike have a number behind PARAM."""
    seen: Counter[Path] = Counter()
    folders = {}
    for run in runs:
        folder = out / run.tracker / (_DEFAULT if run.enhancer == "none" else run.own_name)
        seen[folder] += 1
        number = seen[folder]
        folders[run.name] = folder if number == 1 else folder.with_name(f"{folder.name}-{number}")
    return folders
