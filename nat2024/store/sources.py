"""Finding runs: under a results folder of nat-bench, or in any layout of another toolkit."""

from pathlib import Path

from nat2024.errors import DatasetNotFound
from nat2024.importing import (
    find_groups,
    find_runs,
    groups_of,
    is_results,
    nameless_groups,
    unread_files,
)
from nat2024.store.runs import Run, RunFolder


def dataset_folder(results: str | Path, dataset: str) -> Path:
    """The folder of a dataset's runs.

    That is `RESULTS/DATASET`, else the folder below `results` that is named as the dataset in any
    spelling (`UAVDark135`), else `results` itself if it holds runs, else the folder below it that
    is named as no dataset at all (`tracking_results`). It may lie in an archive, so list it by
    `list_runs` only.

    Raises:
        DatasetNotFound: there is none, or more than one; names what is.
    """
    results = check_results(results)
    nested = results / dataset
    if _holds_runs(nested):
        return nested
    named = groups_of(results, dataset)
    if not named and list_runs(results):
        return results
    below = named or nameless_groups(results)
    if len(below) == 1:
        return below[0]
    if below:
        there = ", ".join(_below(results, folder) for folder in below)
        msg = f"{results}: several folders may be results of {dataset}: {there}; name one of them"
        raise DatasetNotFound(msg)
    there = ", ".join(_below(results, folder) for folder in list_datasets(results)) or "nothing"
    msg = f"{results}: no results of {dataset}; it holds {there}{unread_files(results)}"
    raise DatasetNotFound(msg)


def _below(results: Path, folder: Path) -> str:
    return folder.relative_to(results).as_posix()


def _holds_runs(folder: Path) -> bool:
    return is_results(folder) and bool(_own_runs(folder) or find_runs(folder, single=False))


def check_results(results: str | Path) -> Path:
    """The results folder or archive, if it is one; else `DatasetNotFound`."""
    results = Path(results)
    if (results / "run.json").is_file():
        msg = f"{results}: this is one run; name the folder of its dataset, {results.parent}"
        raise DatasetNotFound(msg)
    if results.is_file() and not is_results(results):
        msg = f"{results}: neither a folder of results nor a .zip archive of them"
        raise DatasetNotFound(msg)
    if not is_results(results):
        msg = f"{results}: no such results folder; `nat-bench run` makes one"
        raise DatasetNotFound(msg)
    return results


def list_datasets(results: str | Path) -> list[Path]:
    """Folders under `results` that hold runs, one a dataset."""
    children = _subfolders(Path(results))
    own = {child for child in children if _own_runs(child)}
    return sorted(own | set(find_groups(results)))


def list_runs(folder: str | Path) -> list[Run]:
    """The runs directly in a folder (or archive), sorted by name.

    Folders with a manifest, or with times as nat-bench stores them, are `RunFolder`s; all others
    are recognised by their shape (`nat2024.importing`). A folder of sequences alone is one run.
    """
    path = Path(folder)
    own = _own_runs(path)
    found = find_runs(path, single=not own)
    foreign = [run for run in found if not any(run.path.is_relative_to(o.path) for o in own)]
    runs: list[Run] = [*own, *foreign]
    return sorted(runs, key=lambda run: run.name)


def _own_runs(folder: Path) -> list[RunFolder]:
    return [RunFolder(child) for child in _subfolders(folder) if _is_own(child)]


def _is_own(folder: Path) -> bool:
    if (folder / "run.json").is_file():
        return True
    return any(folder.glob("time/*.csv")) and any(folder.glob("*.txt"))


def _subfolders(folder: Path) -> list[Path]:
    if not folder.is_dir():
        return []
    return sorted(p for p in folder.iterdir() if p.is_dir() and not p.name.startswith("."))
