"""The table of layouts, and finding the runs of a folder by its shape."""

import logging
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TypeVar

from nat2024.archives import is_archive
from nat2024.errors import NatBenchError
from nat2024.importing import bundles, got10k, otb_matlab, pytracking, texts, vot, zipped
from nat2024.importing.names import names_annotation, names_container, names_dataset
from nat2024.importing.runs import ForeignRun
from nat2024.importing.tree import Folder, is_folder, open_folder

_log = logging.getLogger("nat2024")
_Found = TypeVar("_Found")


@dataclass(frozen=True, slots=True)
class Layout:
    """One way in which toolkits store the results of a tracker.

    Attributes:
        name: as reports have it.
        words: its shape, and who writes it.
        find: the runs in the folder of one tracker, none where its shape is another.
    """

    name: str
    words: str
    find: Callable[[Folder], list[ForeignRun]]


LAYOUTS = (
    Layout(vot.NAME, vot.WORDS, vot.find),
    Layout(texts.NAME, texts.WORDS, texts.find),
    Layout(otb_matlab.NAME, otb_matlab.WORDS, otb_matlab.find),
    Layout(got10k.NAME, got10k.WORDS, got10k.find),
    Layout(pytracking.NAME, pytracking.WORDS, pytracking.find),
)
"""Layouts of one tracker's folder, the more particular shapes first. Archives of one tracker
(`zipped`) and bundles (`bundles`) are told by what they are."""

_DEPTH = 4
_NOT_OPENED = (".pkl", ".pickle", ".npy", ".pt", ".pth")


def find_runs(path: str | Path, *, single: bool = True) -> list[ForeignRun]:
    """The runs directly in a folder (or archive), each recognised by its own shape.

    Args:
        path: the folder that holds one folder, archive or set of files a tracker; it may be a
            .zip archive or lead through one.
        single: whether a folder of sequences is taken for one run, named as the folder is.

    Returns:
        Runs sorted by name, names unique. What cannot be read is told in one line of log each, and
        the rest is kept.
    """
    folder = open_folder(Path(path))
    runs = _attempt(folder.path, partial(bundles.find, folder))
    if not runs:
        runs = [run for child in _children(folder) for run in find_in(child)]
        runs += _attempt(folder.path, partial(otb_matlab.find, folder))
        for archive in zipped.archives_in(folder):
            runs += _attempt(archive, partial(_in_archive, archive))
    if not runs and single:
        runs = find_in(folder)
    return sorted(_with_unique_names(runs), key=lambda run: run.name)


def _in_archive(archive: Path) -> list[ForeignRun]:
    return bundles.find(open_folder(archive)) or zipped.find(archive)


def find_in(folder: Folder) -> list[ForeignRun]:
    """The runs in the folder of one tracker."""
    for layout in LAYOUTS:
        found = _attempt(folder.path, partial(layout.find, folder))
        if found:
            return found
    return []


def _children(folder: Folder) -> Iterator[Folder]:
    for name in folder.folders:
        if names_annotation(name):  # boxes, but nobody's results
            continue
        yield from _attempt(folder.path / name, partial(_listed, folder, name))


def _listed(folder: Folder, name: str) -> list[Folder]:
    return [folder.child(name)]


def _attempt(path: Path, find: Callable[[], list[_Found]]) -> list[_Found]:
    """What `find` gives; where it fails, nothing and one line of log."""
    try:
        return find()
    except NatBenchError as error:
        text = str(error)
        _log.warning("left out: %s", text if str(path) in text else f"{path}: {text}")
        return []


def _with_unique_names(runs: list[ForeignRun]) -> list[ForeignRun]:
    """Runs of one name told apart by their datasets, then by their layouts, then by number."""
    for more in ("dataset", "layout"):
        counts = Counter(run.name for run in runs)
        runs = [
            _renamed(run, f"{run.name}-{getattr(run, more)}")
            if counts[run.name] > 1 and getattr(run, more)
            else run
            for run in runs
        ]
    seen: Counter[str] = Counter()
    unique = []
    for run in runs:
        seen[run.name] += 1
        number = seen[run.name]
        name = run.name if number == 1 else f"{run.name}-{number}"
        unique.append(_renamed(run, name))
    return unique


def _renamed(run: ForeignRun, name: str) -> ForeignRun:
    return replace(run, name=name, named=(run.tracker, run.enhancer))


def find_groups(path: str | Path) -> list[Path]:
    """Folders that hold runs, under a folder or archive, at most four levels deep."""
    top = open_folder(Path(path))
    return [group for child in _children(top) for group in _groups(child, _DEPTH - 1)]


def _groups(folder: Folder, depth: int) -> Iterator[Path]:
    runs = find_runs(folder.path, single=False)
    if runs:
        yield folder.path
    for child in _children(folder) if depth else ():
        # the folders of a run are its sequences, which look like runs themselves
        if not any(run.path.is_relative_to(child.path) for run in runs):
            yield from _groups(child, depth - 1)


def groups_of(path: str | Path, dataset: str) -> list[Path]:
    """Those folders of runs that are named as a dataset."""
    return [group for group in find_groups(path) if names_dataset(group.name, dataset)]


def nameless_groups(path: str | Path) -> list[Path]:
    """Those folders of runs whose names tell of results alone."""
    return [group for group in find_groups(path) if names_container(group.name)]


def unread_files(path: str | Path) -> str:
    """What lies in a folder but is never opened, as the end of a message; else an empty text."""
    root = Path(path)
    if not is_folder(root):
        return ""
    folder = open_folder(root)
    pickles = [n for n in folder.files if n.lower().endswith(_NOT_OPENED)]
    return f"; {', '.join(pickles[:3])} may hold code and is never opened" if pickles else ""


def is_results(path: str | Path) -> bool:
    """Whether a path leads to a folder or archive at all."""
    path = Path(path)
    return is_archive(path) or is_folder(path)
