"""Bars: trackers with and without an enhancer, and gains with their intervals."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from nat2024_reports.figures.looks import Look
from nat2024_reports.style import BLUE, GREY, PAGE, figure_style, new_figure, plain_text, shortened

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

METRICS = {
    "precision_20": "Precision (20 px)",
    "normalized_precision_20": "Normalized precision (0.20)",
    "success_auc": "Success (AUC)",
    "average_overlap": "Average overlap",
}
"""Scores that have a panel, where the protocol defines them."""

HATCH = "//////"
PALE = 0.35
_BAR, _GROUP_GAP = 0.145, 0.07  # inches
_NOTE = "pale, hatched: the 95 % interval includes 0, or fewer than 6 sequences"


def overall_table(summary: "pd.DataFrame", gains: "pd.DataFrame") -> "pd.DataFrame":
    """What a figure of bars draws: one row a metric and run, with its gain where it has one.

    Args:
        summary: `run, tracker` and scores.
        gains: `run, metric, gain, certain`, gains in percent.

    Returns:
        `metric, tracker, run, value, gain, certain`; gains of trackers alone are NaN.
    """
    columns = [name for name in METRICS if name in summary and summary[name].notna().any()]
    long = summary.melt(["run", "tracker"], columns, var_name="metric")
    wanted = gains.reindex(columns=["run", "metric", "gain", "certain"])
    rows = long.merge(wanted, on=["run", "metric"], how="left")
    rows["certain"] = rows.certain.fillna(False).astype(bool)
    return rows[["metric", "tracker", "run", "value", "gain", "certain"]]


def overall_figure(table: "pd.DataFrame", looks: Mapping[str, Look]) -> "Figure":
    """Scores of trackers with and without enhancers as bars, a group a tracker.

    Bars of trackers alone are hollow; gains in percent stand at the bars of the others, grey where
    they are not certain.

    Args:
        table: of `overall_table`.
        looks: by run; bars follow their order within a tracker.
    """
    metrics = [metric for metric in METRICS if (table.metric == metric).any()]
    places = _places(table, list(looks))
    height = 0.55 + _BAR * (max(places.values(), default=0) + 1.5)
    with figure_style():
        figure = new_figure(PAGE, max(height, 1.3))
        figure.set_layout_engine("constrained", w_pad=0.04)
        panels: Any = figure.subplots(1, max(len(metrics), 1), squeeze=False, sharey=True)[0]
        for axes, metric in zip(panels, metrics, strict=False):
            rows = table[(table.metric == metric) & table.value.notna()]
            for row in rows.itertuples():
                _bar(axes, row, places[str(row.run)], looks[str(row.run)])
            axes.set_xlabel(METRICS[metric])
            axes.set_xlim(0, max(float(rows.value.max()) * 1.5, 0.05))  # room for the numbers
            axes.set_xticks([tick for tick in axes.get_xticks() if tick <= 1])
            axes.tick_params(axis="y", length=0)
        first = panels[0]
        first.set_yticks(list(places.values()), [looks[run].label for run in places])
        first.set_ylim(max(places.values(), default=0) + 0.8, -0.8)
        return figure


def _places(table: "pd.DataFrame", order: list[str]) -> dict[str, float]:
    """Where the bar of each run lies, in widths of a bar from the top; trackers are apart."""
    rows = table.drop_duplicates("run").set_index("run").tracker
    trackers = list(dict.fromkeys(rows[run] for run in order if run in rows.index))
    places: dict[str, float] = {}
    place = 0.0
    for tracker in trackers:
        for run in order:
            if run in rows.index and rows[run] == tracker:
                places[run] = place
                place += 1
        place += _GROUP_GAP / _BAR
    return places


def _bar(axes: "Axes", row: Any, place: float, look: Look) -> None:
    face = "white" if look.is_dashed else look.color
    axes.barh(place, row.value, height=0.8, color=face, edgecolor=look.color, linewidth=0.9)
    text, color = f"{row.value:.3f}", "black"
    if np.isfinite(row.gain):
        text += f"  {_percent(row.gain)}"
        color = "black" if row.certain else GREY
    style: dict[str, Any] = {"va": "center", "fontsize": 6, "color": color}
    axes.annotate(
        text, (row.value, place), (2, 0), textcoords="offset points", annotation_clip=False, **style
    )


def gains_figure(
    table: "pd.DataFrame", *, colors: Mapping[str, str] | None = None, title: str = ""
) -> "Figure":
    """Differences to the tracker alone as bars with their intervals, one panel a metric.

    Bars that are not certain are pale and hatched. The gain in percent stands at the right.

    Args:
        table: `label, metric, difference, difference_low, difference_high, gain, certain`; bars
            follow the order of the labels.
        colors: by label; one colour where left out.
        title: over all panels, may be empty.
    """
    metrics = [metric for metric in METRICS if (table.metric == metric).any()]
    labels = list(dict.fromkeys(table.label))
    height = 0.9 + _BAR * 1.15 * (len(labels) + 0.6) + (0.2 if title else 0)
    with figure_style():
        figure = new_figure(PAGE, max(height, 1.4))
        figure.set_layout_engine("constrained", w_pad=0.04)
        panels: Any = figure.subplots(1, max(len(metrics), 1), squeeze=False, sharey=True)[0]
        for axes, metric in zip(panels, metrics, strict=False):
            _gain_panel(axes, table[table.metric == metric], labels, colors or {})
            axes.set_title(METRICS[metric])
            axes.set_xlabel("Difference")
        first = panels[0]
        names = [plain_text(shortened(label, 40)) for label in labels]
        first.set_yticks(np.arange(len(labels)), names)
        first.set_ylim(len(labels) - 0.4, -0.6)
        if title:
            figure.suptitle(plain_text(title), fontsize=8, weight="bold")
        if not table.certain.all():
            figure.supxlabel(_NOTE, fontsize=6, color=GREY)
        return figure


def _gain_panel(
    axes: "Axes", rows: "pd.DataFrame", labels: list[str], colors: Mapping[str, str]
) -> None:
    rows = rows[np.isfinite(rows.difference)]
    row: Any  # as pandas types it, a cell may be anything
    for row in rows.itertuples():
        place, color = labels.index(str(row.label)), colors.get(str(row.label), BLUE)
        _gain_bar(axes, row, place, color)
        if np.isfinite(row.gain):
            axes.annotate(
                _percent(row.gain),
                (1.0, place),
                (-1, 0),
                xycoords=("axes fraction", "data"),
                textcoords="offset points",
                ha="right",
                va="center",
                fontsize=6,
                color="black" if row.certain else GREY,
            )
    ends = rows[["difference", "difference_low", "difference_high"]].to_numpy(dtype=np.float64)
    low, high = min(np.nanmin(ends, initial=0), 0.0), max(np.nanmax(ends, initial=0), 0.0)
    wide = max(high - low, 0.01)
    axes.set_xlim(low - 0.05 * wide, high + 0.5 * wide)  # room for the percentages
    axes.axvline(0, color="black", linewidth=0.8)
    axes.grid(axis="x")
    axes.tick_params(axis="y", length=0)


def _gain_bar(axes: "Axes", row: Any, place: int, color: str) -> None:
    style: dict[str, Any] = {"color": color}
    if not row.certain:
        style = {"facecolor": (*_rgb(color), PALE), "edgecolor": color, "hatch": HATCH}
    axes.barh(place, row.difference, height=0.7, linewidth=0.5, **style)
    if np.isfinite(row.difference_low) and np.isfinite(row.difference_high):
        # an interval of resamples need not hold the value itself
        low = max(row.difference - row.difference_low, 0.0)
        high = max(row.difference_high - row.difference, 0.0)
        axes.errorbar(
            row.difference,
            place,
            xerr=[[low], [high]],
            color="black",
            linewidth=0.9,
            capsize=2,
            capthick=0.9,
        )


def _percent(gain: float) -> str:
    return f"{gain:+.1f} %".replace("-", "\N{MINUS SIGN}")


def _rgb(color: str) -> tuple[float, float, float]:
    from matplotlib.colors import to_rgb

    return to_rgb(color)
