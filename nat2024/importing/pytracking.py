"""`tracking_results/TRACKER/PARAM[_RUN]/[DATASET/]SEQ.txt`: pytracking, tabs and whole numbers.

The shape alone could be datasets with trackers in them; the tabs, the files of seconds beside the
results and the names tell.
"""

import re
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

from nat2024.importing.names import names_container, names_dataset
from nat2024.importing.runs import ForeignRun
from nat2024.importing.texts import sequence_files, time_files
from nat2024.importing.tree import Folder, has_tabs

NAME = "pytracking"
WORDS = "TRACKER/PARAM[_RUN]/[DATASET/]SEQUENCE.txt, parted by tabs (pytracking)"

_ROOT = "tracking_results"
_REPEAT = re.compile(r"(?P<parameters>.+)_(?P<run>\d{3})")
_DEFAULT = "default"


def find(folder: Folder) -> list[ForeignRun]:
    """The runs of a tracker, one a PARAM and dataset; repeats of a PARAM are one run."""
    if folder.texts() or names_dataset(folder.name) or names_container(folder.name):
        return []
    found: dict[tuple[str, str], list[Folder]] = defaultdict(list)
    for parameters, dataset, holder in _holders(folder):
        found[parameters, dataset].append(holder)
    return [_run(folder, key, holders) for key, holders in sorted(found.items())]


def _holders(folder: Folder) -> Iterator[tuple[str, str, Folder]]:
    """(parameters, dataset, folder of texts) of all that look like this toolkit's."""
    for child in folder.children():
        match = _REPEAT.fullmatch(child.name)
        parameters = match["parameters"] if match else child.name
        sure = folder.path.parent.name == _ROOT or match is not None
        if _is_holder(child, sure):
            yield parameters, "", child
            continue
        for inner in child.children():
            if names_dataset(inner.name) and _is_holder(inner, sure):
                yield parameters, inner.name, inner


def _is_holder(folder: Folder, sure: bool) -> bool:
    files = sequence_files(folder)
    if not files or not has_tabs(next(iter(files.values()))):
        return False
    return sure or bool(time_files(folder, files))


def _run(folder: Folder, key: tuple[str, str], holders: list[Folder]) -> ForeignRun:
    parameters, dataset = key
    files: dict[str, tuple[Path, ...]] = {}
    times: dict[str, Path] = {}
    for holder in holders:
        own = sequence_files(holder)
        for sequence, path in own.items():
            files[sequence] = (*files.get(sequence, ()), path)
        times = {**time_files(holder, own), **times}
    path = holders[0].path if len(holders) == 1 else folder.path
    name = _name(folder.name, parameters)
    return ForeignRun(name, path, NAME, files, times, dataset=dataset)


def _name(tracker: str, parameters: str) -> str:
    """`dimp` and `dimp50` make dimp50, `siamapnpp` and `default` siamapnpp."""
    if parameters == _DEFAULT:
        return tracker
    return parameters if parameters.startswith(tracker) else f"{tracker}-{parameters}"
