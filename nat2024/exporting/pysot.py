"""`DATASET/RUN/SEQ.txt`, comma: pysot, SNOT and most authors' folders."""

from collections.abc import Sequence
from pathlib import Path

from nat2024.boxes import write_boxes
from nat2024.exporting.taking import TakenRun
from nat2024.store import DatasetRecord

WORDS = "DATASET/RUN/SEQUENCE.txt"
LOSES = "times are not part of this layout"


def write(runs: Sequence[TakenRun], dataset: DatasetRecord, out: Path) -> dict[str, Path]:
    """Write runs of a dataset; gives the folder of each."""
    folders = {run.name: out / dataset.name / run.name for run in runs}
    for run in runs:
        for sequence, boxes in run.boxes.items():
            write_boxes(folders[run.name] / f"{sequence}.txt", boxes)
    return folders
