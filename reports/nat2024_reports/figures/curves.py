"""Precision, normalized precision and success plots with ranked legends."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from nat2024_reports.figures.looks import Look
from nat2024_reports.figures.panels import legend_below, panels
from nat2024_reports.style import COLUMN, GREY, PAGE, figure_style

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PANELS: dict[str, tuple[str, str, str, float]] = {
    "precision": ("Precision plot", "Location error threshold (px)", "Precision", 20),
    "normalized_precision": (
        "Normalized precision plot",
        "Normalized error threshold",
        "Normalized precision",
        0.2,
    ),
    "success": ("Success plot", "Overlap threshold", "Success rate", np.nan),
}
"""By metric: title, label of the thresholds, label of the values, threshold that ranks."""

RANKED_BY = {
    "precision": ("precision_20",),
    "normalized_precision": ("normalized_precision_20", "normalized_precision_auc"),
    "success": ("success_auc", "average_overlap"),
}
"""The score that each legend ranks by, the first that the protocol defines: the curve at 20 px, the
curve at 0.20, the area under it."""

_HEIGHT = 1.6  # inches


def curve_table(curves: "pd.DataFrame", summary: "pd.DataFrame") -> "pd.DataFrame":
    """What a figure of curves draws: the curves with the score that ranks them.

    Runs and metrics without a single finite value are left out; the best run of a metric is first.

    Args:
        curves: `run, metric, threshold, value`.
        summary: `run` and the scores of `RANKED_BY`.

    Returns:
        `metric, run, score_name, score, threshold, value`.
    """
    import pandas as pd

    parts = []
    for metric in PANELS:
        name = ranking_score(summary, metric)
        ranked = summary[np.isfinite(summary[name])] if name else summary.iloc[:0]
        ranked = ranked.sort_values(name, ascending=False, kind="stable") if name else ranked
        for run, score in zip(ranked.run, ranked[name] if name else (), strict=True):
            curve = curves[(curves.run == run) & (curves.metric == metric)]
            if np.isfinite(curve.value).any():
                parts.append(curve.assign(score=score, score_name=name))
    columns = ["metric", "run", "score_name", "score", "threshold", "value"]
    return pd.concat(parts, ignore_index=True)[columns] if parts else pd.DataFrame(columns=columns)


def ranking_score(summary: "pd.DataFrame", metric: str) -> str:
    """The column of scores that stands for a metric, empty where the protocol defines none.

    Args:
        summary: columns of scores.
        metric: a key of `RANKED_BY`.
    """
    there = [name for name in RANKED_BY[metric] if name in summary and summary[name].notna().any()]
    return there[0] if there else ""


def curves_figure(table: "pd.DataFrame", looks: Mapping[str, Look], *, title: str = "") -> "Figure":
    """One panel a metric, each with its legend below, the best run first.

    Args:
        table: of `curve_table`.
        looks: by run.
        title: over all panels, may be empty.
    """
    metrics = [metric for metric in PANELS if (table.metric == metric).any()]
    count = max(len(metrics), 1)
    entries = int(table.groupby("metric").run.nunique().max()) if len(table) else 0
    width = {1: COLUMN, 2: 0.67 * PAGE}.get(count, PAGE)
    with figure_style():
        figure, places = panels(count, width=width, height=_HEIGHT, entries=entries, title=title)
        for axes, metric in zip(places, metrics, strict=False):
            _panel(axes, table[table.metric == metric], looks, metric)
        return figure


def _panel(axes: "Axes", rows: "pd.DataFrame", looks: Mapping[str, Look], metric: str) -> None:
    heading, thresholds, values, ranked = PANELS[metric]
    for place, (run, curve) in enumerate(rows.groupby("run", sort=False)):
        look = looks[str(run)]
        x, y = curve.threshold.to_numpy(), curve.value.to_numpy()
        axes.plot(
            x,
            y,
            linestyle=look.line,
            color=look.color,
            linewidth=1.2,
            marker=look.marker or None,
            markersize=3,
            markevery=(len(x) // 20 * (1 + place % 3), max(len(x) // 6, 1)),
            label=f"[{curve.score.iloc[0]:.3f}] {look.label}",
            zorder=3 - 0.01 * place,  # the best lies on top
        )
    if np.isfinite(ranked):
        axes.axvline(ranked, color=GREY, linewidth=0.6, linestyle=":", zorder=1)
    axes.set_title(heading)
    axes.set(xlabel=thresholds, ylabel=values)
    highest = float(rows.threshold.max())
    axes.set_xlim(0, highest)
    axes.set_xticks(np.linspace(0, highest, 6))
    top = _ceiling(rows.value.max())
    axes.set_ylim(0, top * 1.01)  # half a line more, so that a curve at the top is whole
    axes.grid()
    legend_below(axes)


def _ceiling(highest: float) -> float:
    """The next tenth above, so that low curves fill their panel."""
    return float(min(1.0, np.ceil(10 * highest + 0.2) / 10)) if np.isfinite(highest) else 1.0
