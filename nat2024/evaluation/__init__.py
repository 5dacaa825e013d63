"""Scoring stored results against a dataset: files in, tables out, nothing recomputed on the way."""

from nat2024.evaluation.scoring import dataset_of_runs, evaluate
from nat2024.evaluation.tables import SCORES, Evaluation, RunScores, SequenceCurves

__all__ = [
    "SCORES",
    "Evaluation",
    "RunScores",
    "SequenceCurves",
    "dataset_of_runs",
    "evaluate",
]
