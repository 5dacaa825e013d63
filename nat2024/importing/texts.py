"""`TRACKER/SEQ.txt`: pysot, SNOT, UDAT, the authors' folders, LaSOT, GOT-10k's OPE sets.

Beside the sequences may lie `SEQ_time.txt` and `SEQ_object_presence_scores.txt` (pytracking's
writer, used by DarkLighter and SCT) or `times/SEQ_time.txt` (GOT-10k's toolkit, UDAT). LaSOT's
folders are called `TRACKER_tracking_result`.
"""

from collections.abc import Mapping
from pathlib import Path

from nat2024.importing.runs import ForeignRun
from nat2024.importing.tree import Folder, read_head

NAME = "texts"
WORDS = "TRACKER/SEQUENCE.txt (pysot, SNOT, LDEnhancer, UDAT, SCT, LaSOT)"

_TIMES = "times"
_TIME, _PRESENCE = "_time.txt", "_object_presence_scores.txt"
_LASOT = "_tracking_result"


def find(folder: Folder) -> list[ForeignRun]:
    """The run in a folder of texts, if it is one."""
    files = sequence_files(folder)
    if not files or _are_labels(next(iter(files.values()))):
        return []
    name = folder.name.removesuffix(_LASOT) or folder.name
    one_each = {sequence: (path,) for sequence, path in files.items()}
    return [ForeignRun(name, folder.path, NAME, one_each, time_files(folder, files))]


def _are_labels(path: Path) -> bool:
    """Whether a text is one line of 0 and 1, so an attribute (`UAVDark70_att_LAI`) and no box."""
    lines = read_head(path).split()
    fields = lines[0].split(",") if len(lines) == 1 else []
    return len(fields) not in (0, 4) and set(fields) <= {"0", "1"}


def sequence_files(folder: Folder) -> dict[str, Path]:
    """Texts of boxes by sequence; no sequence ends in `_time`.

    A text that is named as a folder beside it is what pysot's tester says of that tracker's speed.
    """
    names = [n for n in folder.texts() if not n.endswith((_TIME, _PRESENCE))]
    by_sequence = {name[: -len(".txt")]: folder.path / name for name in names}
    return {name: path for name, path in by_sequence.items() if name not in folder.folders}


def time_files(folder: Folder, files: Mapping[str, Path]) -> dict[str, Path]:
    """Texts of seconds by sequence, beside the results or in `times/`."""
    beside = set(folder.files)
    apart = set(folder.child(_TIMES).files) if _TIMES in folder.folders else set()
    found = {}
    for sequence in files:
        name = f"{sequence}{_TIME}"
        if name in beside:
            found[sequence] = folder.path / name
        elif name in apart:
            found[sequence] = folder.path / _TIMES / name
    return found
