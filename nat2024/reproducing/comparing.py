"""A paper's tables beside what published result files give on a user's copy of the dataset."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import msgspec

from nat2024.datasets import load_dataset, validate
from nat2024.errors import DatasetNotFound, UsageError
from nat2024.evaluation import Evaluation, evaluate
from nat2024.importing import names_dataset
from nat2024.reproducing.published import PUBLICATIONS, Publication, PublishedRow
from nat2024.store import check_results, list_datasets, list_runs
from nat2024.types import Dataset, closest

DIGITS = 3
"""Of scores in the paper's tables; gains are percent, made from the scores as printed."""

_HALF_DIGIT = 0.5 * 10**-DIGITS
_METRICS = {"success": "success_auc", "precision": "precision_20"}


class ComparedRow(msgspec.Struct, frozen=True, kw_only=True):
    """One row of a published table, and what the files give. None where there is no number.

    Attributes:
        table: its name.
        method: as the paper names it.
        run: the run that was scored, empty where there is none.
        source: the folder that it lies in.
        sequences: how many were scored.
        paper: `success, precision, success_gain, precision_gain` as printed.
        files: the same, from the files, in full precision; gains are made from scores rounded as
            the paper prints them, so that equal scores have equal gains.
        difference: files minus paper, both rounded as the paper prints them.
        equal: whether every number is equal as printed; None where there are no files.
        note: why there are none, or what is odd.
    """

    table: str
    method: str
    run: str
    source: str
    sequences: int
    paper: dict[str, float | None]
    files: dict[str, float | None]
    difference: dict[str, float | None]
    equal: bool | None
    note: str


class Reproduction(msgspec.Struct, frozen=True, kw_only=True):
    """What `reproduce` found.

    Attributes:
        paper: its title.
        source: authors, venue, year and tables.
        dataset: name of the dataset.
        protocol: what scores mean.
        copy_problems: what is wrong with the copy of the dataset, one line each.
        rows: every row of every table.
        remarks: what a reader must know of the result files, one line each.
        left_out: whether results were left out because they could not be read or scored.
    """

    paper: str
    source: str
    dataset: str
    protocol: str
    copy_problems: tuple[str, ...]
    rows: tuple[ComparedRow, ...]
    remarks: tuple[str, ...]
    left_out: bool

    @property
    def ok(self) -> bool:
        """Whether the copy is as published and every result was scored."""
        return not (self.copy_problems or self.left_out)


class _Scored(NamedTuple):
    run: str
    source: Path
    sequences: int
    scores: dict[str, float]


def reproduce(
    name: str,
    results: Sequence[str | Path],
    root: str | Path | None = None,
    *,
    protocol: str | None = None,
) -> Reproduction:
    """Score published result files and put them beside the paper's numbers.

    Args:
        name: of `PUBLICATIONS`, such as "ldenhancer".
        results: folders or archives of result files, in any layout. Where one holds several
            folders of runs, those that are named as another dataset are left alone. A run that
            comes twice is taken from the first.
        root: the copy of the dataset; None as `nat2024.load_dataset`.
        protocol: None takes the paper's.

    Raises:
        UsageError: no such publication.
        DatasetNotFound: the dataset or the results are not there.
        DatasetIncomplete: the copy's files do not fit together.
    """
    if name not in PUBLICATIONS:
        msg = f"nothing to reproduce of {name!r}{closest(name, PUBLICATIONS)}"
        raise UsageError(msg)
    publication = PUBLICATIONS[name]
    if not results:
        msg = f"no results; name the folders of {publication.results}"
        raise UsageError(msg)
    dataset = load_dataset(publication.dataset, root)
    report = validate(publication.dataset, root, look_at_frames=False)
    chosen = protocol or publication.protocol
    evaluations = [
        (folder, evaluate(folder, dataset, protocol=chosen, skip_faulty=True))
        for path in results
        for folder in _folders(check_results(path), publication.dataset)
    ]
    scored, twice = _by_enhancer(evaluations, publication)
    return Reproduction(
        paper=publication.title,
        source=publication.source,
        dataset=dataset.name,
        protocol=evaluations[0][1].protocol.title,
        copy_problems=tuple(problem.message for problem in report.problems),
        rows=tuple(_rows(publication, scored, dataset)),
        remarks=(*_remarks(evaluations), *twice),
        left_out=any(
            run.foreign and run.foreign.unreadable for _, e in evaluations for run in e.runs
        ),
    )


def _folders(results: Path, dataset: str) -> list[Path]:
    """The folders of runs under one that was named, but for those of other datasets."""
    if list_runs(results):
        return [results]
    below = list_datasets(results)
    chosen = [f for f in below if names_dataset(f.name, dataset) or not names_dataset(f.name)]
    if not chosen:
        there = ", ".join(folder.name for folder in below) or "nothing"
        msg = f"{results}: no results of {dataset}; it holds {there}"
        raise DatasetNotFound(msg)
    return chosen


def _by_enhancer(
    evaluations: list[tuple[Path, Evaluation]], publication: Publication
) -> tuple[dict[str, _Scored], list[str]]:
    """Scores of the publication's tracker by enhancer, and what is said of runs that come twice."""
    found: dict[str, _Scored] = {}
    twice = []
    for folder, evaluation in evaluations:
        rows: list[dict[Any, Any]] = evaluation.summary().to_dict(orient="records")
        for row in rows:
            if row["tracker"] != publication.tracker:
                continue
            enhancer = row["enhancer"]
            if enhancer in found:
                first = found[enhancer]
                twice.append(f"{folder / row['run']}: not taken, {first.source / first.run} is")
                continue
            scores = {name: float(row[column]) for name, column in _METRICS.items()}
            found[enhancer] = _Scored(row["run"], folder, int(row["sequences"]), scores)
    return found, twice


def _remarks(evaluations: list[tuple[Path, Evaluation]]) -> list[str]:
    return [
        f"{folder}: {line}" for folder, evaluation in evaluations for line in evaluation.remarks()
    ]


def _rows(
    publication: Publication, scored: dict[str, _Scored], dataset: Dataset
) -> "list[ComparedRow]":
    base = scored.get("none")
    return [
        _compare(table.name, row, scored.get(row.enhancer), base, len(dataset))
        for table in publication.tables
        for row in table.rows
    ]


def _compare(
    table: str, row: PublishedRow, found: _Scored | None, base: _Scored | None, sequences: int
) -> ComparedRow:
    paper = {
        "success": row.success,
        "precision": row.precision,
        "success_gain": _number(row.success_gain),
        "precision_gain": _number(row.precision_gain),
    }
    files = _from_files(row, found, base)
    difference = {key: _difference(files[key], paper[key]) for key in paper}
    known = [value for value in difference.values() if value is not None]
    return ComparedRow(
        table=table,
        method=row.method,
        run=found.run if found else "",
        source=str(found.source) if found else "",
        sequences=found.sequences if found else 0,
        paper=paper,
        files=files,
        difference=difference,
        equal=all(abs(value) < _HALF_DIGIT for value in known) if found else None,
        note=_note(row, found, base, sequences),
    )


def _from_files(
    row: PublishedRow, found: _Scored | None, base: _Scored | None
) -> dict[str, float | None]:
    files: dict[str, float | None] = {}
    for metric in _METRICS:
        value = _number(found.scores[metric]) if found else None
        plain = _number(base.scores[metric]) if base else None
        files[metric] = value
        gain = None
        if value is not None and plain is not None and row.enhancer != "none":
            rounded = round(plain, DIGITS)
            gain = 100 * (round(value, DIGITS) - rounded) / rounded if rounded else None
        files[f"{metric}_gain"] = gain
    return {key: files[key] for key in ("success", "precision", "success_gain", "precision_gain")}


def _note(row: PublishedRow, found: _Scored | None, base: _Scored | None, sequences: int) -> str:
    if found is None:
        return row.files if row.files.startswith("no ") else f"not among the results: {row.files}"
    if found.sequences < sequences:
        return f"over {found.sequences} of {sequences} sequences"
    if base is None and row.enhancer != "none":
        return "no gain without results of the tracker alone"
    return ""


def _difference(files: float | None, paper: float | None) -> float | None:
    if files is None or paper is None:
        return None
    return round(round(files, DIGITS) - round(paper, DIGITS), DIGITS) + 0.0


def _number(value: float) -> float | None:
    return None if math.isnan(value) else value
