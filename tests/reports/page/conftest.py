"""A made-up page: two trackers with two enhancers and without, on sequences with pictures."""

from collections.abc import Callable
from typing import Any

import cv2
import numpy as np
import pandas as pd
import pytest

from nat2024_reports.page import (
    Column,
    DatasetPart,
    FailureTable,
    LightCurve,
    Page,
    ProtocolScores,
    Run,
    SequencePart,
    Subset,
    Thumbnail,
    Track,
)

SCORES = ("success_auc", "precision_20", "normalized_precision_20", "normalized_precision_auc")
THRESHOLDS = {"success": 21, "precision": 51, "normalized_precision": 51}
LAST = {"success": 1.0, "precision": 50.0, "normalized_precision": 0.5}


def picture() -> bytes:
    image = np.full((24, 32, 3), 60, np.uint8)
    image[8:16, 10:20] = 200
    return cv2.imencode(".jpg", image)[1].tobytes()


def summary_of(runs: tuple[Run, ...], sequences: int, shift: float) -> pd.DataFrame:
    rows = [
        {
            "run": run.name,
            "sequences": sequences,
            "frames": 40 * sequences,
            **{score: 0.3 + 0.05 * place + shift for score in SCORES},
        }
        for place, run in enumerate(runs)
    ]
    return pd.DataFrame(rows)


def curves_of(runs: tuple[Run, ...]) -> pd.DataFrame:
    parts = [
        pd.DataFrame(
            {
                "run": run.name,
                "metric": metric,
                "threshold": np.linspace(0, LAST[metric], count),
                "value": np.linspace(1 if metric == "success" else 0, 0.1 * place, count),
            }
        )
        for place, run in enumerate(runs)
        for metric, count in THRESHOLDS.items()
    ]
    return pd.concat(parts, ignore_index=True)


def gains_of(runs: tuple[Run, ...], sequences: int) -> pd.DataFrame:
    plain = {run.tracker: run.name for run in runs if run.enhancer == "none"}
    rows = [
        {
            "run": run.name,
            "base": plain[run.tracker],
            "metric": score,
            "sequences": sequences,
            "base_value": 0.3,
            "difference": 0.05,
            "difference_low": 0.01 - 0.02 * (place % 2),
            "difference_high": 0.09,
            "gain": 16.667,
            "gain_low": 3.3 - 6.6 * (place % 2),
            "gain_high": 30.0,
            "improved": 2 / 3,
            "certain": place % 2 == 0,
        }
        for place, run in enumerate(runs)
        if run.enhancer != "none" and run.tracker in plain
        for score in SCORES
    ]
    return pd.DataFrame(rows, columns=list(rows[0]) if rows else ["run", "base", "metric"])


def subsets_of(
    runs: tuple[Run, ...], names: tuple[str, ...], attribute: str, shift: float = 0.0
) -> tuple[Subset, ...]:
    def subset(kind: Any, name: str, chosen: tuple[str, ...], provenance: str) -> Subset:
        count = len(chosen)
        table = summary_of(runs, count, shift + 0.01 * (kind != "all"))
        return Subset(
            kind, name, provenance, chosen, table, curves_of(runs), gains_of(runs, count), "fast"
        )

    return (
        subset("all", "", names, "published"),
        subset("attribute", attribute, names[:2], "computed"),
        subset("attribute", "LR", names[:1], "published"),
        subset("category", "car", names[1:], "published"),
    )


def sequence_of(name: str, runs: tuple[Run, ...], attribute: str, place: int) -> SequencePart:
    random = np.random.default_rng(place)
    frames = 40
    tracks = {
        run.name: Track(
            overlap=np.clip(random.uniform(0, 1, frames), 0, 1),
            center_error=random.uniform(0, 80, frames),
            losses=(10 + place,) if run.enhancer == "none" else (),
        )
        for run in runs
    }
    boxes = {run.name: (10.0 + i, 8.0, 10.0, 8.0) for i, run in enumerate(runs)}
    window = (0.0, 0.0, 32.0, 24.0)
    return SequencePart(
        name=name,
        frames=frames,
        category="car" if place else "person",
        attributes={attribute: "computed", "LR": "published"},
        tracks=tracks,
        light=(LightCurve("Luminance", "0..1", np.arange(0, 40, 10), np.linspace(0.1, 0.2, 4)),),
        light_means={"unevenness": 1.0 + place},
        thumbnails=(
            Thumbnail(12, "worst", picture(), window, (10.0, 8.0, 10.0, 8.0), boxes),
            Thumbnail(3, "best", picture(), window, None, boxes, run=runs[0].name),
        ),
    )


def dataset_of(
    name: str,
    trackers: tuple[str, ...] = ("alpha", "beta"),
    enhancers: tuple[str, ...] = ("none", "clahe", "ldenhancer"),
    sequences: tuple[str, ...] = ("bike1", "car2", "truck10"),
    attribute: str = "FM",
    remarks: tuple[str, ...] = (),
) -> DatasetPart:
    runs = tuple(
        Run(t if e == "none" else f"{t}+{e}", t, e, "patch", 50.0)
        for t in trackers
        for e in enhancers
    )
    by_sequence = pd.DataFrame(
        [
            {
                "run": run.name,
                "sequence": sequence,
                **dict.fromkeys(SCORES, 0.1 * (i + 1) + 0.01 * j),
            }
            for i, run in enumerate(runs)
            for j, sequence in enumerate(sequences)
        ]
    )
    losses = pd.DataFrame(
        [
            {"run": runs[0].name, "sequence": s, "first_loss": 11 + i}
            for i, s in enumerate(sequences)
        ]
    )
    return DatasetPart(
        name=name,
        runs=runs,
        protocols=(
            ProtocolScores("pysot", "first", subsets_of(runs, sequences, attribute), by_sequence),
            ProtocolScores(
                "strict", "second", subsets_of(runs, sequences, attribute, 0.1), by_sequence
            ),
        ),
        sequences=tuple(sequence_of(s, runs, attribute, i) for i, s in enumerate(sequences)),
        failures=FailureTable((Column("first_loss", "first loss", 0),), losses),
        light_measures=(Column("unevenness", "Unevenness", 2, "Stops"),),
        remarks=remarks,
    )


@pytest.fixture(scope="session")
def make_dataset() -> Callable[..., DatasetPart]:
    """Makes one dataset of the page; names can be chosen."""
    return dataset_of


@pytest.fixture(scope="session")
def small_page() -> Page:
    """Two datasets, `day` with one run only."""
    return Page(
        "Night tracking",
        (
            dataset_of("night", remarks=("one remark",)),
            dataset_of("day", trackers=("alpha",), enhancers=("none",)),
        ),
    )
