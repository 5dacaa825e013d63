"""What enhancers gain over the tracker alone, with intervals."""

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import numpy as np

from nat2024.metrics import PairedGains, paired_bootstrap, sequence_weights
from nat2024.store import split_run_name
from nat2024.types import Floats

if TYPE_CHECKING:
    import pandas as pd

    from nat2024.evaluation.tables import Evaluation, RunScores

By: TypeAlias = Literal["attribute", "category"]

_METRICS = ("success_auc", "precision_20", "normalized_precision_20")
"""Those that a protocol does not define are left out."""

_KEYS = ("dataset", "run", "tracker", "enhancer", "scope", "protocol", "base")
_NUMBERS = (
    "sequences",
    "value",
    "base_value",
    "difference",
    "difference_low",
    "difference_high",
    "gain",
    "gain_low",
    "gain_high",
    "improved",
    "certain",
)
_PLAIN = "none"


def gains_of(evaluation: "Evaluation", by: By | None, resamples: int, seed: int) -> "pd.DataFrame":
    """The table of `Evaluation.gains`."""
    import pandas as pd

    pairs = list(paired_runs(evaluation))
    names, tables = _tables(evaluation, pairs)
    rows: list[dict[str, Any]] = []
    for group, chosen in _groups(evaluation, by).items():
        picked = [number for number, name in enumerate(names) if chosen is None or name in chosen]
        value, weight, base, share = tables[..., picked]
        found = paired_bootstrap(
            value, base, weights=weight, base_weights=share, resamples=resamples, seed=seed
        )
        rows += _rows(evaluation, pairs, {by: group} if by else {}, found)
    columns = [*_KEYS, *([by] if by else []), "metric", *_NUMBERS]
    return pd.DataFrame(rows, columns=columns)


def paired_runs(evaluation: "Evaluation") -> "Iterator[tuple[RunScores, RunScores]]":
    """Every run with an enhancer, and the run of its tracker alone."""
    plain = [run for run in evaluation.runs if run.enhancer == _PLAIN]
    by_tracker = {run.tracker: run for run in plain}
    by_name = {run.run: run for run in plain}
    for run in evaluation.runs:
        # the text of a tracker tells its variant too, but only where there is a manifest
        base = by_tracker.get(run.tracker) or by_name.get(split_run_name(run.run)[0])
        if run.enhancer != _PLAIN and base is not None:
            yield run, base


def _groups(evaluation: "Evaluation", by: By | None) -> Mapping[str, frozenset[str] | None]:
    """Names of the sequences of each group, None for all."""
    if by is None:
        return {"": None}
    groups = evaluation.attributes if by == "attribute" else evaluation.categories
    return {group: frozenset(names) for group, names in groups.items()}


def _rows(
    evaluation: "Evaluation",
    pairs: "list[tuple[RunScores, RunScores]]",
    group: Mapping[str, str],
    found: PairedGains,
) -> Iterator[dict[str, Any]]:
    for number, (run, plain) in enumerate(pairs):
        keys = (evaluation.dataset, run.run, run.tracker, run.enhancer, run.scope)
        first = dict(zip(_KEYS, (*keys, evaluation.protocol.title, plain.run), strict=True))
        for column, metric in enumerate(_metrics(evaluation)):
            if found.sequences[number, column]:
                numbers = {name: getattr(found, name)[number, column].item() for name in _NUMBERS}
                yield {**first, **group, "metric": metric, **numbers}


def _metrics(evaluation: "Evaluation") -> tuple[str, ...]:
    # the score of GOT-10k itself, where the three others are not defined
    return ("average_overlap",) if evaluation.protocol.name == "got10k-ao" else _METRICS


def _tables(
    evaluation: "Evaluation", pairs: "list[tuple[RunScores, RunScores]]"
) -> tuple[list[str], Floats]:
    """Names of all sequences; values, weights, values and weights of the base of each pair.

    Returns:
        The names, and float64 (4, pairs, metrics, sequences); NaN where a run has no result.
    """
    names = sorted({name for run in evaluation.runs for name in run.sequences})
    metrics = _metrics(evaluation)
    of = {run.run: _table(run, names, metrics) for pair in pairs for run in pair}
    tables = [[*of[run.run], *of[plain.run]] for run, plain in pairs]
    shape = (len(pairs), 4, len(metrics), len(names))
    return names, np.array(tables, dtype=np.float64).reshape(shape).swapaxes(0, 1)


def _table(run: "RunScores", names: list[str], metrics: tuple[str, ...]) -> tuple[Floats, Floats]:
    """Scores and weights (metrics, sequences); NaN where the run has no result."""
    there = [name for name in names if name in run.sequences]
    column = [names.index(name) for name in there]
    scores = [run.sequences[name] for name in there]
    values = np.full((len(metrics), len(names)), np.nan)
    weights = np.ones_like(values)
    if scores:
        for row, metric in enumerate(metrics):
            values[row, column] = [getattr(one, metric) for one in scores]
            weights[row, column] = sequence_weights(scores, metric)
    return values, weights
