"""Scoring stored results against a dataset: files in, tables out, nothing recomputed on the way."""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nat2024.datasets import load_again
from nat2024.errors import DatasetNotFound, LengthMismatch
from nat2024.metrics import (
    NORMALIZED_PRECISION_THRESHOLDS,
    PRECISION_THRESHOLDS,
    SCORE_NAMES,
    SUCCESS_THRESHOLDS,
    DatasetScores,
    Protocol,
    SequenceScores,
    evaluate_boxes,
    get_protocol,
    summarize,
)
from nat2024.store import RunFolder, dataset_folder, list_runs, split_run_name
from nat2024.types import Boxes, Dataset, Flags, Origin, Sequence

if TYPE_CHECKING:
    import pandas as pd

_FIRST = ("success_auc", "precision_20", "normalized_precision_20", "normalized_precision_auc")
SCORES = (*_FIRST, *(name for name in SCORE_NAMES if name not in _FIRST))
"""Columns of scores, the common ones first."""

_THRESHOLDS = {
    "success": SUCCESS_THRESHOLDS,
    "precision": PRECISION_THRESHOLDS,
    "normalized_precision": NORMALIZED_PRECISION_THRESHOLDS,
}
_COMPARED_WITH_STRICT = "pysot"
_STRICT_MATTERS = 0.001
"""A difference to the protocol `strict` below this is not worth a line."""


@dataclass(frozen=True, slots=True)
class RunScores:
    """The scores of one run.

    Attributes:
        run: name of its folder.
        tracker: `NAME[@LABEL]`, followed by ` (VARIANT)` where the variant's weights came with a
            package, such as `siamrpnpp (compact)`.
        enhancer: `NAME[@LABEL]`, "none" for the plain tracker.
        scope: what was enhanced, empty where no manifest tells.
        sequences: scores by sequence.
        missing: names of sequences without a result.
        skipped: by sequence, 0-based numbers of frames that could not be read when it was tracked.
        altered: names of sequences whose length or first box is not what was tracked.
        strict_success: success AUC under the protocol `strict`, NaN where it was not asked.
    """

    run: str
    tracker: str
    enhancer: str
    scope: str
    sequences: dict[str, SequenceScores]
    missing: tuple[str, ...]
    altered: tuple[str, ...]
    skipped: dict[str, list[int]]
    strict_success: float


@dataclass(frozen=True, slots=True)
class Evaluation:
    """Scores of all runs of one dataset; tables are pandas DataFrames.

    Attributes:
        dataset: its name.
        protocol: what the scores mean.
        runs: one entry a run folder.
        attributes: names of the sequences that carry each attribute.
        provenance: where each attribute of a sequence comes from, by sequence and attribute;
            without an entry it is published.
    """

    dataset: str
    protocol: Protocol
    runs: tuple[RunScores, ...]
    attributes: dict[str, tuple[str, ...]] = field(default_factory=dict)
    provenance: dict[str, Mapping[str, str]] = field(default_factory=dict)

    def summary(self) -> "pd.DataFrame":
        """One row a run, over all its sequences."""
        rows = [self._row(run, run.sequences.values()) for run in self.runs]
        return self._frame(rows, [])

    def per_sequence(self) -> "pd.DataFrame":
        """One row a run and sequence."""
        rows = [
            {**self._row(run, [scores]), "sequence": name}
            for run in self.runs
            for name, scores in run.sequences.items()
        ]
        return self._frame(rows, ["sequence"])

    def per_attribute(self) -> "pd.DataFrame":
        """One row a run and attribute, over the sequences that carry it.

        `provenance` is `published`, `computed` or `manual`, or `mixed` where the sequences differ.
        """
        rows = []
        for run in self.runs:
            for attribute, names in self.attributes.items():
                chosen = [name for name in names if name in run.sequences]
                if chosen:
                    row = self._row(run, [run.sequences[name] for name in chosen])
                    provenance = self._provenance(attribute, chosen)
                    rows.append({**row, "attribute": attribute, "provenance": provenance})
        return self._frame(rows, ["attribute", "provenance"])

    def _provenance(self, attribute: str, names: Iterable[str]) -> str:
        found = {self.provenance.get(name, {}).get(attribute, "published") for name in names}
        return found.pop() if len(found) == 1 else "mixed"

    def curves(self) -> "pd.DataFrame":
        """The mean curves of each run: `run, metric, threshold, value`."""
        import pandas as pd

        parts = []
        for run in self.runs:
            scores = self._summarize(run.sequences.values())
            for metric, thresholds in _THRESHOLDS.items():
                curve = getattr(scores, f"{metric}_curve")
                table = {"run": run.run, "metric": metric, "threshold": thresholds, "value": curve}
                parts.append(pd.DataFrame(table))
        columns = ["run", "metric", "threshold", "value"]
        return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame(columns=columns)

    def notes(self) -> dict[str, Any]:
        """What a reader must know beside the scores; empty entries are left out."""
        first = next(iter(self.runs), None)
        truth = first.sequences if first else {}
        invalid = {n: s.invalid_truth for n, s in truth.items() if s.invalid_truth}
        bad = {
            run.run: {n: s.bad_results for n, s in run.sequences.items() if s.bad_results}
            for run in self.runs
        }
        unequal = {
            run.run: {n: lengths for n, s in run.sequences.items() if (lengths := _unequal(s))}
            for run in self.runs
        }
        strict = {run.run: round(run.strict_success, 6) for run in self.runs if self._differs(run)}
        found = {
            "invalid_truth_rows": invalid,
            "bad_result_rows": {run: names for run, names in bad.items() if names},
            "unequal_lengths": {run: names for run, names in unequal.items() if names},
            "missing_sequences": {run.run: list(run.missing) for run in self.runs if run.missing},
            "skipped_frames": {run.run: run.skipped for run in self.runs if run.skipped},
            "altered_sequences": {run.run: list(run.altered) for run in self.runs if run.altered},
            "strict_success_auc": strict,
        }
        return {key: value for key, value in found.items() if value}

    def remarks(self) -> list[str]:
        """The notes as one line each, for people."""
        notes = self.notes()
        by_name = {run.run: run for run in self.runs}
        lines = []
        if rows := notes.get("invalid_truth_rows"):
            lines.append(f"{sum(rows.values())} invalid ground-truth rows in {_names(rows)}")
        for run, rows in notes.get("bad_result_rows", {}).items():
            lines.append(f"{run}: {sum(rows.values())} bad result rows in {_names(rows)}")
        for run, names in notes.get("unequal_lengths", {}).items():
            lines.append(f"{run}: result and ground truth differ in length in {_names(names)}")
        for run, names in notes.get("missing_sequences", {}).items():
            lines.append(f"{run}: no result of {len(names)} sequences, {_names(names)}")
        for run, frames in notes.get("skipped_frames", {}).items():
            count = sum(map(len, frames.values()))
            lines.append(
                f"{run}: {count} unreadable frames repeat the last box in {_names(frames)}"
            )
        for run, names in notes.get("altered_sequences", {}).items():
            lines.append(f"{run}: made on another length or first box in {_names(names)}")
        for run, success in notes.get("strict_success_auc", {}).items():
            ours = self._summarize(by_name[run].sequences.values()).success_auc
            lines.append(f"{run}: success is {ours:.3f} here and {success:.3f} under strict")
        return lines

    def _differs(self, run: RunScores) -> bool:
        ours = self._summarize(run.sequences.values()).success_auc
        return abs(ours - run.strict_success) > _STRICT_MATTERS

    def _summarize(self, scores: Iterable[SequenceScores]) -> DatasetScores:
        return summarize(list(scores), self.protocol)

    def _row(self, run: RunScores, scores: Iterable[SequenceScores]) -> dict[str, Any]:
        scores = list(scores)
        total = self._summarize(scores)
        return {
            "dataset": self.dataset,
            "run": run.run,
            "tracker": run.tracker,
            "enhancer": run.enhancer,
            "scope": run.scope,
            "protocol": self.protocol.title,
            "sequences": len(scores),
            "frames": sum(one.frames for one in scores),
            **{name: getattr(total, name) for name in SCORES},
        }

    def _frame(self, rows: list[dict[str, Any]], extra: list[str]) -> "pd.DataFrame":
        import pandas as pd

        keys = ["dataset", "run", "tracker", "enhancer", "scope", "protocol"]
        columns = [*keys, *extra, "sequences", "frames", *SCORES]
        return pd.DataFrame(rows, columns=columns)


def _unequal(scores: SequenceScores) -> tuple[int, int] | None:
    lengths = scores.length_predicted, scores.length_truth
    return lengths if lengths[0] != lengths[1] else None


def _names(names: Collection[str], count: int = 5) -> str:
    return ", ".join(list(names)[:count]) + (", ..." if len(names) > count else "")


def evaluate(
    results: str | Path,
    dataset: Dataset,
    *,
    protocol: str | Protocol = "pysot",
    on_length: str | None = None,
    runs: Collection[str] | None = None,
) -> Evaluation:
    """Score every run of a dataset, or those named.

    Args:
        results: the folder that `nat-bench run` wrote, or a folder of run folders.
        dataset: the ground truth. A sequence with boxes on some frames only is scored on those
            frames, and only in runs that have it.
        protocol: a name, or a `Protocol` with options.
        on_length: what to do where a result and its truth differ in length: None as the protocol
            says, "error", "pad" (missing rows fail) or "cut".
        runs: names of run folders; the others are not even read.

    Raises:
        DatasetNotFound: there are no results of this dataset.
        BoxFileError: a result file cannot be read.
        LengthMismatch: lengths differ and may not.
    """
    chosen = get_protocol(protocol)
    folder = dataset_folder(results, dataset.name)
    scored = tuple(
        scores
        for run in list_runs(folder)
        if (runs is None or run.name in runs)
        and (scores := _score_run(run, dataset, chosen, on_length)).sequences
    )
    if not scored:
        msg = f"{folder}: no result of any sequence of {dataset.name}"
        raise DatasetNotFound(msg)
    names = dataset.attribute_names or sorted({a for s in dataset for a in s.attributes})
    carriers = {a: tuple(s.name for s in dataset if a in s.attributes) for a in names}
    attributes = {attribute: found for attribute, found in carriers.items() if found}
    provenance = {s.name: s.provenance for s in dataset if s.provenance}
    return Evaluation(dataset.name, chosen, scored, attributes, provenance)


def dataset_of_runs(folder: str | Path, *, lenient: bool = False) -> Dataset:
    """Load the dataset that the manifests of a folder of runs name.

    Raises:
        DatasetNotFound: no manifest tells, or it is no longer there.
    """
    manifests = [manifest for run in list_runs(folder) if (manifest := run.manifest())]
    records = [manifest.dataset for manifest in manifests if manifest.dataset.source]
    if not records:
        msg = f"{folder}: no manifest tells which dataset this is; name it with --dataset"
        raise DatasetNotFound(msg)
    record = records[0]
    try:
        return load_again(
            Origin(record.source, record.root, lenient or record.lenient, record.rule)
        )
    except DatasetNotFound as error:
        msg = f"{error}; {folder} was made from it, name it with --dataset if it has moved"
        raise DatasetNotFound(msg) from None


def _score_run(
    run: RunFolder, dataset: Dataset, protocol: Protocol, on_length: str | None
) -> RunScores:
    manifest = run.manifest()
    tracker, enhancer = split_run_name(run.name)
    if manifest and manifest.tracker.title == tracker:
        tracker = manifest.tracker.shown
    finished = set(run.finished())
    scores: dict[str, SequenceScores] = {}
    strict: list[SequenceScores] = []
    for sequence in dataset:
        if sequence.name not in finished or not len(sequence.boxes):
            continue
        pair = _pair(run, sequence)
        # GOT-10k clips boxes to the image; no other protocol needs to look at one.
        size = sequence.frame_size if protocol.name == "got10k-ao" else None
        scores[sequence.name] = pair.score(protocol.for_sequence(size), on_length)
        if protocol.name == _COMPARED_WITH_STRICT:
            strict.append(pair.score(get_protocol("strict"), on_length))
    missing = [s.name for s in dataset if s.is_annotated and s.name not in finished]
    starts = manifest.starts if manifest else {}
    unread = manifest.skipped_frames if manifest else {}
    altered = [n for n in scores if n in starts and starts[n] != dataset[n].start_digest()]
    return RunScores(
        run=run.name,
        tracker=tracker,
        enhancer=enhancer,
        scope=manifest.scope if manifest else "",
        sequences=scores,
        missing=tuple(missing),
        altered=tuple(altered),
        skipped={name: frames for name, frames in unread.items() if name in scores},
        strict_success=summarize(strict, "strict").success_auc,
    )


@dataclass(frozen=True, slots=True)
class _Pair:
    """A result and its ground truth, on the frames that have one."""

    source: Path
    predicted: Boxes
    truth: Boxes
    visible: Flags | None

    def score(self, protocol: Protocol, on_length: str | None) -> SequenceScores:
        return evaluate_boxes(
            self.predicted,
            self.truth,
            visible=self.visible,
            protocol=protocol,
            on_length=on_length,
            name=str(self.source),
        )


def _pair(run: RunFolder, sequence: Sequence) -> _Pair:
    source = run.box_file(sequence.name)
    predicted, truth, visible = run.boxes(sequence.name), sequence.boxes, sequence.visible
    if sequence.keyframes is None:
        return _Pair(source, predicted, truth, visible)
    if len(predicted) != len(sequence):
        msg = (
            f"{source}: {len(predicted)} rows, but the sequence has {len(sequence)} frames, "
            "and boxes on some of them only"
        )
        raise LengthMismatch(msg)
    rows = sequence.keyframes
    return _Pair(source, predicted[rows], truth[rows], None if visible is None else visible[rows])
