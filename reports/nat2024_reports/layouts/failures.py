"""Where runs lost their targets, and what the light was there."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from nat2024_reports.tables import MISSING, Cell, Column, Table, number, words

if TYPE_CHECKING:
    import pandas as pd

_PLAIN = "none"


@dataclass(frozen=True, slots=True)
class _Shown:
    """A column of numbers: its heading, how they are written, and who reads them."""

    heading: str
    form: str
    where: Literal["all", "page", "file"] = "all"


_LIGHT = {
    "luminance_at_loss": _Shown("Grey at loss", ".3f"),
    "unevenness_at_loss": _Shown("Uneven at loss", ".2f"),
    "over_enhancement_at_loss": _Shown("Over enh.", ".3f"),
}
_SUMMARY = {
    "sequences": _Shown("Seq.", ".0f"),
    "sequences_lost": _Shown("with loss", ".0f"),
    "first_loss": _Shown("First loss", ".0f"),
    "losses": _Shown("Losses", ".0f"),
    "recoveries": _Shown("Found again", ".0f", "file"),
    "lost_percent": _Shown("Lost %", ".1f"),
    "drift": _Shown("Drift px", ".2f"),
    **_LIGHT,
}
_DETAILS = {
    "frames": _Shown("Frames", ".0f", "file"),
    "first_loss": _Shown("First loss", ".0f"),
    "losses": _Shown("Losses", ".0f"),
    "recoveries": _Shown("Found again", ".0f", "file"),
    "lost": _Shown("Frames lost", ".0f"),
    "longest": _Shown("Longest span", ".0f", "file"),
    "drift": _Shown("Drift px", ".2f"),
    **_LIGHT,
}


def failures_table(
    failures: "pd.DataFrame", dataset: str, loss_frames: int, notes: Iterable[str] = ()
) -> Table:
    """One row a run: how often and when it lost its target, and the light there.

    First loss, drift and light are medians over the sequences in which the target is lost.

    Args:
        failures: `Evidence.failures()`.
        dataset: its name.
        loss_frames: frames without overlap in a row that make a loss.
        notes: what could not be looked at.
    """
    groups = []
    for _, of_tracker in failures.groupby("tracker", sort=False):
        rows = []
        for _, of_run in of_tracker.groupby("run", sort=False):
            first = of_run.iloc[0]
            cells = [words(str(first.tracker)), words(_enhancer(first.enhancer))]
            rows.append((*cells, *_numbers(_summed(of_run), _SUMMARY)))
        groups.append(tuple(rows))
    columns = _columns(("Tracker", "Enhancer"), _SUMMARY)
    footnotes = [
        f"lost: no overlap in {loss_frames} frames in a row; frames are counted from 0",
        "first loss, drift and light: medians over the sequences with a loss",
        *_explained(),
    ]
    return _table(
        f"Losses of the target on {dataset}", columns, groups, [*footnotes, *notes], dataset
    )


def losses_table(
    failures: "pd.DataFrame", dataset: str, loss_frames: int, notes: Iterable[str] = ()
) -> Table:
    """One row for each run and sequence in which the target is lost, by sequence.

    Arguments as in `failures_table`.
    """
    lost = failures[failures.losses > 0]
    groups = []
    for _, of_sequence in lost.groupby("sequence", sort=True):
        rows = []
        for row in of_sequence.to_dict(orient="records"):
            cells = [words(str(row[key])) for key in ("sequence", "tracker")]
            cells.append(words(_enhancer(row["enhancer"])))
            rows.append((*cells, *_numbers(row, _DETAILS)))
        groups.append(tuple(rows))
    columns = _columns(("Sequence", "Tracker", "Enhancer"), _DETAILS)
    never = len(failures) - len(lost)
    footnotes = [
        f"lost: no overlap in {loss_frames} frames in a row; frames are counted from 0",
        f"never lost: {never} of {len(failures)} tracked sequences",
        *_explained(),
    ]
    return _table(
        f"Losses by sequence on {dataset}", columns, groups, [*footnotes, *notes], dataset
    )


def _summed(rows: "pd.DataFrame") -> dict[str, float]:
    lost = rows[rows.losses > 0]
    frames = int(rows.frames.sum())
    found = {
        "sequences": float(len(rows)),
        "sequences_lost": float(len(lost)),
        "losses": float(rows.losses.sum()),
        "recoveries": float(rows.recoveries.sum()),
        "lost_percent": 100 * float(rows.lost.sum()) / frames if frames else math.nan,
    }
    for name in ("first_loss", "drift", *_LIGHT):
        values = lost[name].to_numpy(dtype=np.float64, na_value=np.nan)
        known = values[np.isfinite(values)]
        found[name] = float(np.median(known)) if len(known) else math.nan
    return found


def _numbers(row: Mapping[Any, Any], shown: Mapping[str, _Shown]) -> list[Cell]:
    cells = []
    for name, one in shown.items():
        value = row[name]
        is_known = isinstance(value, int | float | np.number) and not math.isnan(value)
        cells.append(number(float(value), one.form) if is_known else Cell(MISSING, math.nan))
    return cells


def _enhancer(name: object) -> str:
    return MISSING if name == _PLAIN else str(name)


def _columns(headings: Iterable[str], shown: Mapping[str, _Shown]) -> tuple[Column, ...]:
    return (
        *(Column(heading, is_words=True) for heading in headings),
        *(
            Column(one.heading, name, part="light" if name in _LIGHT else "", where=one.where)
            for name, one in shown.items()
        ),
    )


def _explained() -> list[str]:
    return [
        "drift: growth of the centre error in px a frame before the loss",
        "grey: mean level around the target, 0..1; uneven: spread of light around it in stops",
        "over enh.: how far bright parts of the search region were taken towards white, 0..1",
    ]


def _table(
    caption: str,
    columns: tuple[Column, ...],
    groups: list[tuple[tuple[Cell, ...], ...]],
    footnotes: list[str],
    dataset: str,
) -> Table:
    return Table(caption, columns, tuple(groups), tuple(footnotes), {"Dataset": dataset})
