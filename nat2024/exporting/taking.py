"""Taking runs as they are to be written: repeats apart, boxes checked, each fault one line."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from nat2024.errors import NatBenchError
from nat2024.importing import ForeignRun, compare_first_rows
from nat2024.store import ImportRecord, Manifest, Run, run_name
from nat2024.types import Boxes, Dataset, Floats, closest

_ONE_PIXEL = (1.0, 1.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class TakenRun:
    """One run (or one repeat of it) with all that can be written of it.

    Attributes:
        name: as it was called where it comes from.
        tracker: name, with its label.
        enhancer: name, with its label; "none" for the plain tracker.
        boxes: float64 (n, 4) by sequence.
        seconds: float64 (n,) of each frame by sequence, where stored.
        manifest: what made it, None for foreign runs.
        imported: where a foreign run comes from, None for nat-bench's own.
        left_out: why a sequence is not written, by its name.
        remarks: what a reader must know, one line each.
    """

    name: str
    tracker: str
    enhancer: str
    boxes: dict[str, Boxes]
    seconds: dict[str, Floats]
    manifest: Manifest | None
    imported: ImportRecord | None
    left_out: dict[str, str] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()

    @property
    def own_name(self) -> str:
        """The name that nat-bench gives such a run."""
        return run_name(self.tracker, self.enhancer)


def take_run(
    run: Run, dataset: Dataset | None, *, accept_restarts: bool, shift_origin: bool
) -> Iterator[TakenRun]:
    """Read a run whole: one for each of its repeats, labelled `rN` where there are several."""
    restarts = isinstance(run, ForeignRun) and run.restarts
    if accept_restarts and isinstance(run, ForeignRun):
        run = run.one_pass()
    left_out: dict[str, str] = {}
    stored: dict[str, list[Boxes]] = {}
    for name in run.finished():
        try:
            repeats = run.repeats(name)
        except NatBenchError as error:
            left_out[name] = str(error)
            continue
        fault = _fault(name, repeats, dataset)
        if fault:
            left_out[name] = fault
        else:
            stored[name] = repeats
    remarks: list[str] = []
    if dataset is not None:
        stored, remarks = _at_origin(stored, dataset, shift=shift_origin)
    if restarts and stored:
        empty = sum(int(np.isnan(b).any(axis=1).sum()) for each in stored.values() for b in each)
        remarks.append(f"started anew after failures: {empty} rows hold no box and are NaN")
    count = max((len(boxes) for boxes in stored.values()), default=1)
    for number in range(count):
        boxes = {name: b[number] for name, b in stored.items() if number < len(b)}
        taken = _taken(run, boxes, left_out if number == 0 else {}, tuple(remarks))
        yield taken if count == 1 else _labelled(taken, f"r{number + 1}")


def _taken(
    run: Run, boxes: dict[str, Boxes], left_out: dict[str, str], remarks: tuple[str, ...]
) -> TakenRun:
    seconds = {name: run.frame_seconds(name) for name in boxes}
    imported = None
    if isinstance(run, ForeignRun):
        imported = ImportRecord(run.name, run.layout, str(run.path))
    return TakenRun(
        name=run.name,
        tracker=run.tracker,
        enhancer=run.enhancer,
        boxes=boxes,
        seconds={n: s for n, s in seconds.items() if s is not None and len(s) == len(boxes[n])},
        manifest=run.manifest(),
        imported=imported,
        left_out=left_out,
        remarks=remarks,
    )


def _labelled(run: TakenRun, label: str) -> TakenRun:
    return replace(run, name=f"{run.name}-{label}", tracker=f"{run.tracker}@{label}")


def _fault(name: str, repeats: Sequence[Boxes], dataset: Dataset | None) -> str:
    """Why a result does not belong to a dataset, or an empty text."""
    if dataset is None:
        return ""
    if name not in dataset:
        known = [sequence.name for sequence in dataset]
        return f"{dataset.name} has no sequence {name}{closest(name, known)}"
    length = len(dataset[name])
    wrong = [len(boxes) for boxes in repeats if len(boxes) != length]
    if not wrong:
        return ""
    hint = "; the tracker may have left out the first frame" if wrong[0] == length - 1 else ""
    return f"{wrong[0]} rows, but the sequence has {length} frames{hint}"


def _at_origin(
    stored: dict[str, list[Boxes]], dataset: Dataset, *, shift: bool
) -> tuple[dict[str, list[Boxes]], list[str]]:
    """The same with rows that begin at 0 shifted, where that is asked, and what to say of it."""
    first = {name: repeats[0][0] for name, repeats in stored.items()}
    truth = {name: dataset[name].boxes[0] for name in stored if len(dataset[name].boxes)}
    rows = compare_first_rows(first, truth)
    if rows is None:
        return stored, []
    remarks = [rows.text] if any(rows.offset) else []
    if rows.others:
        remarks.append(f"started on another box than the annotated one: {', '.join(rows.others)}")
    if not (shift and rows.is_zero_based):
        return stored, remarks
    moved = {n: [boxes + np.array(_ONE_PIXEL) for boxes in each] for n, each in stored.items()}
    return moved, ["all rows shifted by (+1, +1) px"]
