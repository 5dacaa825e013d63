"""`DATASET/RUN/SEQ/SEQ_001.txt` with three decimals, and `SEQ_time.txt`: GOT-10k's toolkit."""

from collections.abc import Sequence
from pathlib import Path

from nat2024.exporting.taking import TakenRun
from nat2024.files import write_atomic
from nat2024.store import DatasetRecord

WORDS = "DATASET/RUN/SEQUENCE/SEQUENCE_001.txt, SEQUENCE_time.txt"
LOSES = "boxes are kept to three decimals"


def write(runs: Sequence[TakenRun], dataset: DatasetRecord, out: Path) -> dict[str, Path]:
    """Write runs of a dataset; gives the folder of each."""
    folders = {run.name: out / dataset.name / run.name for run in runs}
    for run in runs:
        for sequence, boxes in run.boxes.items():
            folder = folders[run.name] / sequence
            rows = (",".join(f"{value:.3f}" for value in row) for row in boxes.tolist())
            seconds = run.seconds.get(sequence)
            if seconds is not None:
                lines = "".join(f"{value:.8f}\n" for value in seconds.tolist())
                write_atomic(folder / f"{sequence}_time.txt", lines)
            write_atomic(folder / f"{sequence}_001.txt", "\n".join([*rows, ""]))
    return folders
