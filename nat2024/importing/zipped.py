"""`TRACKER.zip`: one archive a tracker with `SEQ.txt` in it (CDT, TrackingNet), read in place."""

import logging
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from nat2024.archives import is_archive
from nat2024.importing import texts
from nat2024.importing.runs import ForeignRun
from nat2024.importing.tree import Folder, open_folder

_log = logging.getLogger("nat2024")
_SUFFIX = ".zip"

NAME = "zipped"
WORDS = "TRACKER.zip with SEQUENCE.txt in it (CDT, TrackingNet)"


def archives_in(folder: Folder) -> Iterator[Path]:
    """The archives that lie directly in a folder; those inside another archive are told."""
    for name in folder.files:
        if not name.lower().endswith(_SUFFIX):
            continue
        path = folder.path / name
        if is_archive(path):
            yield path
        else:
            _log.warning("left out: %s: an archive inside an archive is not read", path)


def find(archive: Path) -> list[ForeignRun]:
    """The run in an archive, whose texts may lie in one folder, or a chain of such."""
    folder = open_folder(archive)
    while not folder.texts() and len(folder.folders) == 1:
        folder = folder.child(folder.folders[0])
    return [replace(run, name=archive.stem, layout=NAME) for run in texts.find(folder)]
