"""Scores of one dataset as tables."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from nat2024.evaluation.foreign import ForeignNotes
from nat2024.evaluation.gains import By, gains_of
from nat2024.evaluation.notes import notes_of, remarks_of
from nat2024.metrics import (
    NORMALIZED_PRECISION_THRESHOLDS,
    PRECISION_THRESHOLDS,
    SCORE_NAMES,
    SUCCESS_THRESHOLDS,
    DatasetScores,
    Protocol,
    Scores,
    SequenceScores,
    summarize,
)
from nat2024.metrics.bootstrap import RESAMPLES
from nat2024.metrics.scores import CURVE_COLUMNS, ROW_LENGTH
from nat2024.store import Manifest
from nat2024.types import Floats

if TYPE_CHECKING:
    import pandas as pd

_FIRST = ("success_auc", "precision_20", "normalized_precision_20", "normalized_precision_auc")
SCORES = (*_FIRST, *(name for name in SCORE_NAMES if name not in _FIRST))
"""Columns of scores, the common ones first."""

_CURVES = ("success_curve", "precision_curve", "normalized_precision_curve")
_THRESHOLDS = {
    "success": SUCCESS_THRESHOLDS,
    "precision": PRECISION_THRESHOLDS,
    "normalized_precision": NORMALIZED_PRECISION_THRESHOLDS,
}


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
        manifest: what made the run, None for foreign results.
        foreign: what was seen while results without a manifest were read.
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
    manifest: Manifest | None = None
    foreign: ForeignNotes | None = None


@dataclass(frozen=True, slots=True, eq=False)
class SequenceCurves:
    """The curves of one run by sequence.

    Attributes:
        sequences: their names, one a row of the arrays.
        success: float64 (S, 21).
        precision: float64 (S, 51).
        normalized_precision: float64 (S, 51), NaN where the protocol has none.
    """

    sequences: tuple[str, ...]
    success: Floats
    precision: Floats
    normalized_precision: Floats


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
        categories: names of the sequences of each category of target.
    """

    dataset: str
    protocol: Protocol
    runs: tuple[RunScores, ...]
    attributes: dict[str, tuple[str, ...]] = field(default_factory=dict)
    provenance: dict[str, Mapping[str, str]] = field(default_factory=dict)
    categories: dict[str, tuple[str, ...]] = field(default_factory=dict)

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

    def per_category(self) -> "pd.DataFrame":
        """One row a run and category of target, over its sequences.

        Sequences of which nothing tells the category are in none.
        """
        rows = [
            {**self._row(run, [run.sequences[name] for name in chosen]), "category": category}
            for run in self.runs
            for category, names in self.categories.items()
            if (chosen := [name for name in names if name in run.sequences])
        ]
        return self._frame(rows, ["category"])

    def gains(
        self, *, by: By | None = None, resamples: int = RESAMPLES, seed: int = 0
    ) -> "pd.DataFrame":
        """What each enhancer gains over its tracker alone, and how sure that is.

        Both are compared on the sequences that both have, by paired bootstrap over these
        (`nat2024.metrics.paired_bootstrap`). Runs whose tracker alone was not run are left out.

        Args:
            by: one comparison a run, or a run and "attribute" or "category".
            resamples: how often sequences are drawn.
            seed: of the draws.

        Returns:
            One row a run, group and metric: `dataset, run, tracker, enhancer, scope, protocol,
            base` (the run of the tracker alone)`, [attribute | category,] metric, sequences,
            value, base_value, difference, difference_low, difference_high, gain, gain_low,
            gain_high` (percent)`, improved` (share of sequences)`, certain` (the interval of the
            difference excludes 0, over at least 6 sequences).
        """
        return gains_of(self, by, resamples, seed)

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

    def timing(self) -> "pd.DataFrame":
        """One row a run whose manifest tells its times.

        Columns `run, tracker, enhancer, scope, device, threads, workers, machine, frames, read_ms,
        enhance_ms, track_ms, first_frame_ms` (means a frame)`, frames_per_second` (enhancing and
        tracking)`, end_to_end_frames_per_second` (reading too).
        """
        import pandas as pd

        rows = [row for run in self.runs if (row := _timing(run))]
        return pd.DataFrame(rows, columns=list(_TIMING))

    def sequence_curves(self) -> dict[str, "SequenceCurves"]:
        """The curves of every sequence, by run."""
        return {run.run: _sequence_curves(run.sequences) for run in self.runs}

    def notes(self) -> dict[str, Any]:
        """What a reader must know beside the scores; empty entries are left out."""
        return notes_of(self)

    def remarks(self) -> list[str]:
        """The notes as few lines for people; what holds for several runs is said once."""
        return remarks_of(self)

    def _summarize(self, scores: Iterable[SequenceScores]) -> DatasetScores:
        return summarize(list(scores), self.protocol)

    def _is_its_own_mean(self, scores: list[SequenceScores]) -> bool:
        """Whether this is one sequence that no rule leaves out, which needs no averaging."""
        if len(scores) != 1 or self.protocol.name in ("otb", "lasot"):
            return False
        return not any(np.isnan(getattr(scores[0], name)[0]) for name in _CURVES)

    def _row(self, run: RunScores, scores: Iterable[SequenceScores]) -> dict[str, Any]:
        scores = list(scores)
        total: Scores = scores[0] if self._is_its_own_mean(scores) else self._summarize(scores)
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


def _sequence_curves(scores: Mapping[str, SequenceScores]) -> SequenceCurves:
    table = np.array([one.row for one in scores.values()]).reshape(len(scores), ROW_LENGTH)
    curves = [table[:, CURVE_COLUMNS[f"{metric}_curve"]].copy() for metric in _THRESHOLDS]
    return SequenceCurves(tuple(scores), *curves)


_TIMING = (
    *("run", "tracker", "enhancer", "scope", "device", "threads", "workers", "machine", "frames"),
    *("read_ms", "enhance_ms", "track_ms", "first_frame_ms"),
    *("frames_per_second", "end_to_end_frames_per_second"),
)


def _timing(run: RunScores) -> dict[str, Any]:
    """The row of `Evaluation.timing`, empty where nothing is known."""
    manifest = run.manifest
    if manifest is None or manifest.timing is None:
        return {}
    times, session = manifest.timing, manifest.sessions[-1] if manifest.sessions else None
    machine = session.machine if session else {}
    stages = ("read", "enhance", "track", "first_frame")
    return {
        "run": run.run,
        "tracker": run.tracker,
        "enhancer": run.enhancer,
        "scope": run.scope,
        "device": manifest.device,
        "threads": manifest.threads,
        "workers": session.workers if session else 1,
        "machine": machine.get("gpu") or machine.get("processor", ""),
        "frames": times.frames,
        **{f"{stage}_ms": 1000 * getattr(times, stage) for stage in stages},
        "frames_per_second": times.frames_per_second,
        "end_to_end_frames_per_second": times.end_to_end_frames_per_second,
    }
