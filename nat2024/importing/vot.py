"""`TRACKER/baseline/SEQ/SEQ_001.txt` and `TRACKER/longterm/SEQ/SEQ_001.txt`: VOT.

Short-term rows are `1` where the tracker was started, `2` where it failed, `0` while it was
skipped, else a box or polygon; such a run is no one-pass result. Long-term rows are boxes after a
first row `1`; `SEQ_001_confidence.value` lies beside.
"""

from pathlib import Path

import numpy as np

from nat2024.boxes import parse_boxes
from nat2024.errors import BoxFileError
from nat2024.importing.got10k import repeated_files
from nat2024.importing.runs import ForeignRun
from nat2024.importing.tree import Folder
from nat2024.types import Boxes

NAME = "vot"
WORDS = "TRACKER/baseline/ or TRACKER/longterm/, then SEQUENCE/SEQUENCE_001.txt (VOT)"

SHORT_TERM, LONG_TERM = "baseline", "longterm"
_CODES = ("0", "1", "2")


def find(folder: Folder) -> list[ForeignRun]:
    """The runs of a tracker: short-term, long-term or both."""
    runs = []
    for kind in (SHORT_TERM, LONG_TERM):
        if kind not in folder.folders:
            continue
        files, times = repeated_files(folder.child(kind))
        if files:
            runs.append((kind, files, times))
    return [
        ForeignRun(
            name=folder.name if len(runs) == 1 else f"{folder.name}-{kind}",
            path=folder.path / kind,
            layout=f"{NAME}-{kind}",
            files=files,
            times=times,
            parse=parse_rows,
            restarts=kind == SHORT_TERM,
        )
        for kind, files, times in runs
    ]


def parse_rows(raw: bytes, path: Path) -> Boxes:
    """Boxes of a VOT text; rows that are codes become NaN."""
    try:
        lines = raw.decode("utf-8").split("\n")
    except UnicodeDecodeError:
        msg = f"{path}: not a text file of boxes"
        raise BoxFileError(msg) from None
    rows = [line.strip() for line in lines]
    while rows and not rows[-1]:
        rows.pop()
    is_box = np.array([row not in _CODES and _is_number(row) is None for row in rows], dtype=bool)
    boxes = np.full((len(rows), 4), np.nan)
    if not is_box.any():
        msg = f"{path}: no boxes in it; expected one row x,y,w,h a frame"
        raise BoxFileError(msg)
    # codes leave empty lines, so that errors name the line that a reader finds
    chosen = [row for row, kept in zip(rows, is_box, strict=True) if kept]
    boxes[is_box] = parse_boxes("\n".join(chosen), source=str(path))
    return boxes


def _is_number(row: str) -> float | None:
    """The number of a row that is one code, such as `1.0000`."""
    try:
        value = float(row)
    except ValueError:
        return None
    return value if value in (0.0, 1.0, 2.0) else None
