"""What gains go with: the light of each sequence beside what an enhancer gained on it."""

from typing import TYPE_CHECKING, Any

import numpy as np

from nat2024.analysis import RankCorrelation, rank_correlation
from nat2024.evaluation import Evaluation
from nat2024.evaluation.gains import paired_runs
from nat2024.evidence.records import LIGHT_COLUMNS, Evidence

if TYPE_CHECKING:
    import pandas as pd

LIGHT_MEASURES = LIGHT_COLUMNS[2:]
"""Columns of `Evidence.light` that gains are held against."""

_KEYS = ("run", "tracker", "enhancer", "base", "sequence", "gain")


def gains_and_light(
    evaluation: Evaluation, evidence: Evidence, metric: str = "success_auc"
) -> "pd.DataFrame":
    """One row for each run with an enhancer and sequence with images.

    Columns: `run, tracker, enhancer, base, sequence, gain`, the difference of `metric` to the
    tracker alone, and `LIGHT_MEASURES`.
    """
    import pandas as pd

    rows: list[dict[str, Any]] = []
    for run, base in paired_runs(evaluation):
        for name in run.sequences.keys() & base.sequences.keys():
            gain = getattr(run.sequences[name], metric) - getattr(base.sequences[name], metric)
            values = (run.run, run.tracker, run.enhancer, base.run, name, float(gain))
            rows.append(dict(zip(_KEYS, values, strict=True)))
    gains = pd.DataFrame(rows, columns=list(_KEYS))
    light = evidence.light()[["sequence", *LIGHT_MEASURES]]
    found = gains.merge(light, on="sequence", how="inner")
    order = {run.run: number for number, run in enumerate(evaluation.runs)}
    return found.sort_values(
        ["run", "sequence"], key=lambda c: c.map(order) if c.name == "run" else c
    ).reset_index(drop=True)


def mean_gains(table: "pd.DataFrame") -> "pd.DataFrame":
    """Gains of each enhancer and sequence, averaged over trackers: sequences are independent.

    Args:
        table: as `gains_and_light` gives it.
    """
    keys = ["enhancer", "sequence"]
    return table.groupby(keys, sort=False)[["gain", *LIGHT_MEASURES]].mean().reset_index()


def correlate_gains(
    table: "pd.DataFrame", measure: str = "unevenness", *, resamples: int = 10_000, seed: int = 0
) -> dict[str, RankCorrelation]:
    """By enhancer, the rank correlation of its mean gain over trackers with a measure of light."""
    means = mean_gains(table)
    return {
        str(enhancer): rank_correlation(
            np.asarray(rows[measure]), np.asarray(rows["gain"]), resamples=resamples, seed=seed
        )
        for enhancer, rows in means.groupby("enhancer", sort=False)
    }
