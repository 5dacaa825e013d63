"""Exporting all runs of a folder."""

from collections.abc import Collection
from dataclasses import replace
from pathlib import Path, PureWindowsPath

import msgspec

from nat2024.errors import DatasetNotFound, ResultConflict, UsageError
from nat2024.exporting.formats import FORMATS, Format
from nat2024.exporting.taking import TakenRun, take_run
from nat2024.store import DatasetRecord, Run, dataset_folder, list_runs
from nat2024.types import Dataset, closest


class ExportedRun(msgspec.Struct, frozen=True):
    """What became of one run.

    Attributes:
        run: its name where it comes from.
        tracker: name, with its label.
        enhancer: name, with its label; "none" for the plain tracker.
        path: the folder or file that it was written to; empty where nothing of it was.
        sequences: how many were written.
        left_out: why a sequence was not written, by its name.
        remarks: what a reader must know, one line each.
    """

    run: str
    tracker: str
    enhancer: str
    path: str
    sequences: int
    left_out: dict[str, str]
    remarks: tuple[str, ...]


class ExportReport(msgspec.Struct, frozen=True):
    """What was exported.

    Attributes:
        format: name of the format.
        dataset: name of the dataset.
        loses: what the format cannot keep, in words.
        runs: every run.
    """

    format: str
    dataset: str
    loses: str
    runs: tuple[ExportedRun, ...]

    @property
    def ok(self) -> bool:
        """Whether nothing was left out."""
        return not any(run.left_out for run in self.runs)


def export_results(
    results: str | Path,
    form: str,
    out: str | Path,
    *,
    dataset: Dataset | None = None,
    runs: Collection[str] | None = None,
    accept_restarts: bool = False,
    shift_origin: bool = False,
) -> ExportReport:
    """Write stored results in another layout.

    Args:
        results: results of one dataset in any layout that `nat2024.importing` knows.
        form: a name of `FORMATS`.
        out: folder to write under.
        dataset: the ground truth; results that do not fit it are left out, and the offset of first
            rows is told. None takes results as they are.
        runs: names of runs; None takes all.
        accept_restarts: take VOT short-term results for one-pass ones; rows without a box are NaN.
        shift_origin: add one pixel to x and y of runs whose first rows all lie (-1, -1) px from
            the annotation; needs `dataset`.

    Raises:
        UsageError: no such format or run, or `shift_origin` without a dataset.
        DatasetNotFound: there are no results.
        ResultConflict: a run is there already.
    """
    chosen = _format(form)
    if shift_origin and dataset is None:
        msg = "shifting the origin needs the annotation to compare with; name the dataset"
        raise UsageError(msg)
    folder = dataset_folder(results, dataset.name) if dataset else Path(results)
    stored = _chosen(list_runs(folder), runs, folder)
    taken = [
        _without_refused(one, chosen)
        for run in stored
        for one in take_run(
            run, dataset, accept_restarts=accept_restarts, shift_origin=shift_origin
        )
    ]
    record = _record(dataset, stored, folder)
    out = Path(out)
    _check_names(record, taken, folder)
    _check_absent(out, record, form)
    written = chosen.write([run for run in taken if run.boxes], record, out)
    return ExportReport(
        form, record.name, chosen.loses, tuple(_exported(run, written) for run in taken)
    )


def _format(form: str) -> Format:
    if form not in FORMATS:
        msg = f"no format {form!r}{closest(form, FORMATS)}; there are {', '.join(FORMATS)}"
        raise UsageError(msg)
    return FORMATS[form]


def _chosen(stored: list[Run], names: Collection[str] | None, folder: Path) -> list[Run]:
    if not stored:
        msg = f"{folder}: holds no results"
        raise DatasetNotFound(msg)
    there = [run.name for run in stored]
    for name in names or ():
        if name not in there:
            msg = f"{folder}: no run {name!r}{closest(name, there)}"
            raise UsageError(msg)
    return [run for run in stored if names is None or run.name in names]


def _without_refused(run: TakenRun, form: Format) -> TakenRun:
    if form.refuse is None:
        return run
    faults = {name: form.refuse(boxes) for name, boxes in run.boxes.items()}
    refused = {name: fault for name, fault in faults.items() if fault}
    kept = {name: boxes for name, boxes in run.boxes.items() if name not in refused}
    return replace(run, boxes=kept, left_out={**run.left_out, **refused})


def _record(dataset: Dataset | None, runs: list[Run], folder: Path) -> DatasetRecord:
    """Which dataset the results are of, as far as anything tells."""
    if dataset is not None:
        origin = dataset.origin
        if origin is None:
            return DatasetRecord(dataset.name)
        return DatasetRecord(dataset.name, origin.source, origin.root, origin.lenient, origin.rule)
    for run in runs:
        manifest = run.manifest()
        if manifest is not None:
            return manifest.dataset
    told = {run.dataset for run in runs if run.dataset}
    return DatasetRecord(told.pop() if len(told) == 1 else folder.stem)


def _check_names(dataset: DatasetRecord, runs: list[TakenRun], folder: Path) -> None:
    """Refuse names that would lead out of the folder that is written to.

    A manifest can hold any text, and whoever wrote it may have meant harm.
    """
    names = [dataset.name]
    for run in runs:
        names += [run.name, run.own_name, run.tracker, run.manifest.run if run.manifest else "run"]
    for name in names:
        drive = PureWindowsPath(name).drive
        if name in ("", ".", "..") or drive or any(letter in name for letter in "/\\\0"):
            msg = f"{folder}: {name!r}, told by a manifest, is no name of a folder"
            raise ResultConflict(msg)


def _check_absent(out: Path, dataset: DatasetRecord, form: str) -> None:
    """Refuse to mix with what is there already."""
    places = {"pytracking": out / "tracking_results", "bundle": out / f"{dataset.name}.zip"}
    place = places.get(form, out / dataset.name)
    if place.is_file() or (place.is_dir() and any(place.iterdir())):
        msg = f"{place}: is there already; choose another folder to export to, or move it away"
        raise ResultConflict(msg)


def _exported(run: TakenRun, written: dict[str, Path]) -> ExportedRun:
    path = written.get(run.name)
    return ExportedRun(
        run=run.name,
        tracker=run.tracker,
        enhancer=run.enhancer,
        path=str(path) if path else "",
        sequences=len(run.boxes),
        left_out=run.left_out,
        remarks=run.remarks,
    )
