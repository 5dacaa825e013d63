"""From files to scores: every run of a folder against its dataset."""

import logging
from collections.abc import Callable, Collection, Iterable
from pathlib import Path

import numpy as np

from nat2024.datasets import list_datasets, load_again, load_dataset
from nat2024.errors import BoxFileError, DatasetNotFound, LengthMismatch, NatBenchError
from nat2024.evaluation.foreign import ScoredRepeats, foreign_notes, runs_of
from nat2024.evaluation.scorers import Scorer, results_of, trim_kept
from nat2024.evaluation.tables import Evaluation, RunScores
from nat2024.importing import names_dataset
from nat2024.metrics import Protocol, average_repeats, get_protocol
from nat2024.metrics.datasets import mean_success
from nat2024.store import Run, dataset_folder, list_runs
from nat2024.types import Dataset, Origin, Sequence

_log = logging.getLogger("nat2024")


def evaluate(
    results: str | Path,
    dataset: Dataset,
    *,
    protocol: str | Protocol = "pysot",
    on_length: str | None = None,
    runs: Collection[str] | None = None,
    skip_faulty: bool = False,
    cache: bool = True,
) -> Evaluation:
    """Score every run of a dataset, or those named.

    Args:
        results: the folder that `nat-bench run` wrote, or a folder or .zip archive of results in
            any layout of another toolkit, read as it lies (`nat2024.importing`). Repeated runs
            are averaged.
        dataset: the ground truth. A sequence with boxes on some frames only is scored on those
            frames, and only in runs that have it.
        protocol: a name, or a `Protocol` with options.
        on_length: what to do where a result and its truth differ in length: None as the protocol
            says, "error", "pad" (missing rows fail) or "cut".
        runs: names of run folders; the others are not even read.
        skip_faulty: leave out results of another toolkit whose length may not differ but does, and
            name them in the notes, instead of raising.
        cache: take scores from the user's cache folder where nothing has changed since they were
            put there, and keep new ones; the numbers are the same to the last bit.

    Raises:
        DatasetNotFound: there are no results of this dataset.
        BoxFileError: a result file of nat-bench's own cannot be read; those of other toolkits
            are left out and named in the notes.
        LengthMismatch: lengths differ and may not.
    """
    chosen = get_protocol(protocol)
    folder = dataset_folder(results, dataset.name)
    scorer = Scorer(chosen, on_length, cache)
    found = [
        _score_run(run, dataset, scorer, skip_faulty=skip_faulty)
        for run in runs_of(list_runs(folder), dataset.name)
        if runs is None or run.name in runs
    ]
    if scorer.has_new:  # what is kept must not grow for ever
        trim_kept()
    scored = tuple(scores for scores in found if scores.sequences)
    empty = [_why_empty(scores) for scores in found if not scores.sequences]
    if not scored:
        why = next((f"; {reason}" for reason in empty if reason), "")
        msg = f"{folder}: no result of any sequence of {dataset.name}{why}"
        raise DatasetNotFound(msg)
    for reason in filter(None, empty):
        _log.warning("left out: %s", reason)
    names = dataset.attribute_names or sorted({a for s in dataset for a in s.attributes})
    attributes = _carriers(dataset, names, lambda s, name: name in s.attributes)
    provenance = {s.name: s.provenance for s in dataset if s.provenance}
    kinds = sorted({s.category for s in dataset if s.category})
    categories = _carriers(dataset, kinds, lambda s, name: name == s.category)
    return Evaluation(dataset.name, chosen, scored, attributes, provenance, categories)


def _why_empty(scores: RunScores) -> str:
    """Why nothing of a run was scored, as far as one line can tell."""
    if scores.foreign is None:
        return ""
    for reason in scores.foreign.unreadable.values():
        return f"{scores.run}: {reason}"
    for name, near in scores.foreign.unknown.items():
        return f"{scores.run}: no sequence {name} in the dataset" + (f", {near}" if near else "")
    return ""


def _carriers(
    dataset: Dataset, names: Collection[str], carries: Callable[[Sequence, str], bool]
) -> dict[str, tuple[str, ...]]:
    """Names of the sequences of each group that has any."""
    found = {name: tuple(s.name for s in dataset if carries(s, name)) for name in names}
    return {name: sequences for name, sequences in found.items() if sequences}


def dataset_of_runs(
    folder: str | Path, *, lenient: bool = False, frameless: bool = False
) -> Dataset:
    """Load the dataset that the manifests of a folder of runs name.

    Where there is none, the folder's own name may be that of a registered dataset, in any spelling
    (`UAVDark135`).

    Args:
        folder: of one dataset's runs.
        lenient: as in `load_dataset`.
        frameless: as in `load_dataset`.

    Raises:
        DatasetNotFound: nothing tells, or it is no longer there.
    """
    manifests = [manifest for run in list_runs(folder) if (manifest := run.manifest())]
    records = [manifest.dataset for manifest in manifests if manifest.dataset.source]
    if not records:
        return _dataset_named(Path(folder), lenient=lenient, frameless=frameless)
    record = records[0]
    try:
        origin = Origin(record.source, record.root, lenient or record.lenient, record.rule)
        return load_again(origin, frameless=frameless)
    except DatasetNotFound as error:
        msg = f"{error}; {folder} was made from it, name it with --dataset if it has moved"
        raise DatasetNotFound(msg) from None


def _dataset_named(folder: Path, *, lenient: bool, frameless: bool) -> Dataset:
    """The registered dataset that a folder of foreign results is named as."""
    name = next((n for n in list_datasets() if names_dataset(folder.name, n)), None)
    if name is None:
        msg = f"{folder}: no manifest tells which dataset this is; name it with --dataset"
        raise DatasetNotFound(msg)
    _log.info("%s: taken for results of %s, as the folder is called", folder, name)
    return load_dataset(name, unannotated=True, frameless=frameless, lenient=lenient)


def _score_run(run: Run, dataset: Dataset, scorer: Scorer, *, skip_faulty: bool) -> RunScores:
    manifest = run.manifest()
    tracker = run.tracker
    if manifest and manifest.tracker.title == tracker:
        tracker = manifest.tracker.shown
    finished = set(run.finished())
    skipped: tuple[type[NatBenchError], ...] = ()
    if manifest is None:
        skipped = (BoxFileError, LengthMismatch) if skip_faulty else (BoxFileError,)
    chosen = [s for s in dataset if s.name in finished and len(s.boxes)]
    scored = _score_sequences(run, chosen, scorer, skipped)
    scores = {name: average_repeats(each) for name, each in scored.repeats.items()}
    starts = manifest.starts if manifest else {}
    unread = manifest.skipped_frames if manifest else {}
    return RunScores(
        run=run.name,
        tracker=tracker,
        enhancer=run.enhancer,
        scope=manifest.scope if manifest else "",
        sequences=scores,
        missing=tuple(s.name for s in dataset if s.is_annotated and s.name not in finished),
        altered=tuple(n for n in scores if n in starts and starts[n] != dataset[n].start_digest()),
        skipped={name: frames for name, frames in unread.items() if name in scores},
        strict_success=mean_success(scored.strict),
        manifest=manifest,
        foreign=None if manifest else foreign_notes(run, dataset, scored, scorer.protocol),
    )


def _score_sequences(
    run: Run,
    sequences: Iterable[Sequence],
    scorer: Scorer,
    skipped: tuple[type[NatBenchError], ...],
) -> ScoredRepeats:
    """Score all repeats of sequences of a run, without those that raise one of these errors."""
    opened, found = scorer.open(run), ScoredRepeats()
    for sequence in sequences:
        try:
            opened.take(results_of(run, sequence.name), sequence)
        except skipped as error:
            found.unreadable[sequence.name] = str(error)
    for name, repeats in opened.finish():
        each = [one.strict for one in repeats]
        if scorer.is_compared:
            found.strict.append(each[0] if len(each) == 1 else float(np.mean(each)))
        found.first_rows[name] = repeats[0].first
        found.repeats[name] = [one.scores for one in repeats]
    return found
