"""From a results folder to evaluations: which dataset it belongs to, and what to say about it."""

import functools
import logging
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nat2024.cli import options as shared
from nat2024.cli.output import rows_of
from nat2024.errors import DatasetNotFound, NatBenchError

log = logging.getLogger("nat2024")

if TYPE_CHECKING:
    from nat2024.evaluation import Evaluation
    from nat2024.metrics import Protocol
    from nat2024.types import Dataset


@dataclass(frozen=True, slots=True)
class Scoring:
    """What is to be scored and how, as the options of `scoring_options` say."""

    results: Path
    dataset: str | None
    root: Path | None
    lenient: bool
    protocol: "Protocol"
    on_length: str | None
    cache: bool = True


def scoring_options(function: Callable[..., Any]) -> Callable[..., Any]:
    """Add the options that say what is scored and how; `function` gets them as one `Scoring`."""

    @shared.stored_results_option
    @shared.dataset_option
    @shared.root_option
    @shared.lenient_option
    @shared.protocol_option
    @shared.protocol_options_option
    @shared.on_length_option
    @shared.cache_option
    @functools.wraps(function)
    def wrapped(
        results: Path,
        dataset: str | None,
        root: Path | None,
        lenient: bool,
        protocol: str,
        protocol_options: tuple[str, ...],
        on_length: str | None,
        cache: bool,
        **others: Any,
    ) -> Any:
        chosen = shared.choose_protocol(protocol, protocol_options)
        wanted = Scoring(results, dataset, root, lenient, chosen, on_length, cache)
        return function(wanted, **others)

    return wrapped


@dataclass(frozen=True, slots=True)
class Scored:
    """The evaluation of one dataset with what it was made from.

    Attributes:
        evaluation: scores of all runs.
        dataset: the ground truth.
        folder: the folder of results, of this dataset or of several.
        cache: whether scores may be kept, and taken from what was kept.
    """

    evaluation: "Evaluation"
    dataset: "Dataset"
    folder: Path
    cache: bool = True


def score(wanted: Scoring, *, computed_attributes: bool = False) -> "list[Evaluation]":
    """The evaluations of `score_with_datasets`."""
    found = score_with_datasets(wanted, computed_attributes=computed_attributes)
    return [one.evaluation for one in found]


def score_with_datasets(wanted: Scoring, *, computed_attributes: bool = False) -> list[Scored]:
    """Evaluate one dataset, or all that a results folder holds where none is named.

    Sequences whose frames are absent are scored too, since only boxes are needed; a line says so.
    With `computed_attributes`, which are measured on frames, sequences carry those too.

    Raises:
        DatasetNotFound: no results, or no way to tell where their dataset is.
    """
    from nat2024.datasets import load_dataset
    from nat2024.evaluation import dataset_of_runs, evaluate
    from nat2024.store import check_results, list_datasets, list_runs

    def scored(folder: Path, dataset: "Dataset") -> Scored:
        described = _with_attributes(dataset) if computed_attributes else dataset
        protocol, on_length = wanted.protocol, wanted.on_length
        cache = wanted.cache
        found = evaluate(folder, described, protocol=protocol, on_length=on_length, cache=cache)
        return Scored(found, described, folder, cache)

    results = check_results(wanted.results)
    if wanted.dataset is not None:
        loaded = load_dataset(
            wanted.dataset,
            wanted.root,
            unannotated=True,
            frameless=True,
            lenient=wanted.lenient,
        )
        return [scored(results, loaded)]
    folders = [results] if list_runs(results) else list_datasets(results)
    if not folders:
        msg = f"{results}: holds no results; `nat-bench run --results {results}` writes some"
        raise DatasetNotFound(msg)
    all_scored, problems = [], []
    for folder in folders:
        try:  # one dataset that has moved must not hide the scores of the others
            dataset = dataset_of_runs(folder, lenient=wanted.lenient, frameless=True)
            all_scored.append(scored(folder, dataset))
        except NatBenchError as error:
            problems.append(error)
    if not all_scored:
        raise problems[0]
    for problem in problems:
        log.error("left out: %s", problem)
    return all_scored


def _with_attributes(dataset: "Dataset") -> "Dataset":
    from nat2024.analysis import with_computed_attributes
    from nat2024.cli.describing import EVERY, frame_bar

    with frame_bar(dataset, EVERY) as step:
        return with_computed_attributes(dataset, every=EVERY, on_frame=step)


def print_notes(evaluations: "Iterable[Evaluation]") -> None:
    """Say on standard error what a reader must know beside the scores."""
    for evaluation in evaluations:
        for line in evaluation.remarks():
            log.info("%s: %s", evaluation.dataset, line)


def document(evaluations: "list[Evaluation]") -> dict[str, Any]:
    """The JSON object of `eval` and `table`."""
    return {
        "protocol": evaluations[0].protocol.title,
        "summary": [row for e in evaluations for row in rows_of(e.summary())],
        "per_sequence": [row for e in evaluations for row in rows_of(e.per_sequence())],
        "per_attribute": [row for e in evaluations for row in rows_of(e.per_attribute())],
        "per_category": [row for e in evaluations for row in rows_of(e.per_category())],
        "gains": [row for e in evaluations for row in rows_of(e.gains())],
        "notes": {e.dataset: e.notes() for e in evaluations},
    }
