"""`TRACKER/SEQ/SEQ_001.txt`: GOT-10k's toolkit and pysot's GOT-10k set, with repeats and times."""

import re
from pathlib import Path

from nat2024.importing.runs import ForeignRun
from nat2024.importing.tree import Folder

NAME = "got10k"
WORDS = "TRACKER/SEQUENCE/SEQUENCE_001.txt, _002 and so on, SEQUENCE_time.txt (GOT-10k toolkit)"


def find(folder: Folder) -> list[ForeignRun]:
    """The run in a folder of sequence folders, if it is one."""
    files, times = repeated_files(folder)
    return [ForeignRun(folder.name, folder.path, NAME, files, times)] if files else []


def repeated_files(folder: Folder) -> tuple[dict[str, tuple[Path, ...]], dict[str, Path]]:
    """Texts of the repeats by sequence, and texts of seconds."""
    files: dict[str, tuple[Path, ...]] = {}
    times: dict[str, Path] = {}
    for child in folder.children():
        repeat = re.compile(rf"{re.escape(child.name)}_\d{{3}}\.txt")
        names = [name for name in child.files if repeat.fullmatch(name)]
        if names:
            files[child.name] = tuple(child.path / name for name in names)
            if f"{child.name}_time.txt" in child.files:
                times[child.name] = child.path / f"{child.name}_time.txt"
    return files, times
