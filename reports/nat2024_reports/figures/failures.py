"""Why runs score as they do: gain against light, and light over time with losses marked."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from nat2024_reports.figures.looks import Look
from nat2024_reports.style import (
    BLACK,
    BLUE,
    GREY,
    ORANGE,
    PAGE,
    VERMILION,
    figure_style,
    new_figure,
    plain_text,
    shortened,
)

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MEASURES = {
    "unevenness": "Unevenness of light over the frame (stops)",
    "target_unevenness": "Unevenness of light around the target (stops)",
    "luminance": "Mean grey level of the frame (0..1)",
}
"""Measures of light that gains are drawn against, with the labels of their axes."""

UNEVEN = "unevenness"
_BAND = 0.16  # inches of one run's band
_LETTERS = 34  # of a run's name beside its band
_UNKNOWN = -1.0  # in place of the strength of a band


@dataclass(frozen=True, slots=True)
class Correlation:
    """A rank correlation as a figure tells it.

    Attributes:
        value: -1..1, NaN where there is none.
        low: lower end of its interval, NaN where there is none.
        high: upper end.
        count: of sequences.
    """

    value: float
    low: float
    high: float
    count: int

    def text(self, between: str = "; ") -> str:
        """`rank correlation +0.42 [+0.11, +0.67]; 40 sequences`."""
        unit = f"{self.count} {'sequence' if self.count == 1 else 'sequences'}"
        if np.isnan(self.value):
            return f"no rank correlation{between}{unit}"
        value = f"rank correlation {self.value:+.2f}"
        if np.isnan(self.low):
            return f"{value}{between}{unit}, too few for an interval"
        return f"{value} [{self.low:+.2f}, {self.high:+.2f}]{between}{unit}"


def gain_against_light_figure(
    table: "pd.DataFrame",
    means: "pd.DataFrame",
    correlations: Mapping[str, Correlation],
    colors: Mapping[str, str],
    *,
    title: str = "",
    gain: str = "Gain in success (AUC)",
    uneven_from: float | None = None,
) -> "Figure":
    """Gain of one enhancer against the light of each sequence, one panel a measure.

    Args:
        table: `tracker, sequence, gain` and measures of light, one row a tracker and sequence.
        means: `sequence, gain` and measures, over trackers.
        correlations: by measure, of the means; these measures are drawn.
        colors: by tracker, as it stands in the table.
        title: above, may be empty.
        gain: label of the gains.
        uneven_from: where uneven light begins, in stops.
    """
    measures = [name for name in MEASURES if name in correlations]
    trackers = list(dict.fromkeys(table.tracker))
    with figure_style():
        figure = new_figure(PAGE, 2.4 + (0.2 if title else 0) + 0.16 * -(-len(trackers) // 4))
        panels = figure.subplots(1, len(measures), sharey=True, squeeze=False)[0]
        for axes, measure in zip(panels, measures, strict=True):
            _scatter(axes, table, means, measure, colors, several=len(trackers) > 1)
            axes.set_xlabel(MEASURES[measure], fontsize=7)
            told = correlations[measure].text("\n").replace("-", "\N{MINUS SIGN}")
            axes.set_title(told, fontsize=6.5)
            if uneven_from is not None and "unevenness" in measure:
                _mark_uneven(axes, uneven_from)
        panels[0].set_ylabel(gain)
        if title:
            figure.suptitle(plain_text(title), fontsize=8, weight="bold")
        handles = [_point(colors[name], "o", name, 3.5) for name in trackers]
        if len(trackers) > 1:
            handles.append(_point(BLACK, "D", "mean over trackers", 4))
        figure.legend(
            handles=handles, loc="outside lower left", ncols=4, handletextpad=0.2, fontsize=6.5
        )
        return figure


def _scatter(
    axes: "Axes",
    table: "pd.DataFrame",
    means: "pd.DataFrame",
    measure: str,
    colors: Mapping[str, str],
    *,
    several: bool,
) -> None:
    axes.axhline(0, color=GREY, linewidth=0.7, zorder=0)
    for tracker, rows in table.groupby("tracker", sort=False):
        axes.plot(
            rows[measure],
            rows["gain"],
            "o",
            color=colors[str(tracker)],
            markersize=3 if several else 4.5,
            alpha=0.55 if several else 0.85,
            markeredgewidth=0,
        )
    if several:
        axes.plot(
            means[measure],
            means["gain"],
            "D",
            color=BLACK,
            markersize=3.8,
            markerfacecolor="none",
            markeredgewidth=0.8,
        )
    axes.margins(x=0.06, y=0.1)
    axes.grid()
    axes.tick_params(labelleft=True)


def _mark_uneven(axes: "Axes", uneven_from: float) -> None:
    low, high = axes.get_xlim()
    if low < uneven_from < high:
        axes.axvline(uneven_from, color=GREY, linewidth=0.7, linestyle=":", zorder=0)
        axes.annotate(
            "uneven",
            (uneven_from, 0.0),
            (2, 2),
            xycoords=("data", "axes fraction"),
            textcoords="offset points",
            fontsize=5.5,
            color=GREY,
        )


def _point(color: str, shape: str, label: str, size: float) -> Any:
    from matplotlib.lines import Line2D

    face = "none" if shape == "D" else color
    name = plain_text(shortened(label, 32))
    return Line2D([], [], ls="", color=color, marker=shape, mfc=face, ms=size, label=name)


@dataclass(frozen=True, slots=True, eq=False)
class LossBand:
    """One run on one sequence.

    Attributes:
        run: its name.
        frames: int (n,), 0-based numbers of the scored frames.
        overlap: float64 (n,), NaN where the truth is not known.
        lost: bool (n,).
        first_loss: frame, None where it is never lost.
    """

    run: str
    frames: npt.NDArray[np.intp]
    overlap: npt.NDArray[np.float64]
    lost: npt.NDArray[np.bool_]
    first_loss: int | None


def losses_figure(
    bands: Sequence[LossBand],
    looks: Mapping[str, Look],
    light: "pd.DataFrame | None",
    *,
    title: str = "",
) -> "Figure":
    """Light over the frames of one sequence, and below when each run had its target.

    Bands are as strong as the overlap, empty where the target is lost; a cross marks the first
    loss, grey is where the truth is not known.

    Args:
        bands: from top to bottom.
        looks: by run.
        light: `frame, luminance, target_luminance` (both 0..1) and `unevenness,
            target_unevenness` (stops), None without images.
        title: above, may be empty.
    """
    heights = ([0.85, 0.85] if light is not None else []) + [0.12 + _BAND * len(bands)]
    with figure_style():
        figure = new_figure(PAGE, sum(heights) + 0.55 + (0.2 if title else 0))
        panels = figure.subplots(
            len(heights), 1, sharex=True, squeeze=False, height_ratios=heights
        )[:, 0]
        if light is not None:
            _draw_light(panels[0], panels[1], light)
        _draw_bands(panels[-1], bands, looks)
        for axes in panels[:-1]:
            for band in bands:
                if band.first_loss is not None:
                    look = looks[band.run]
                    axes.axvline(band.first_loss, color=look.color, ls=look.line, lw=0.6, alpha=0.7)
        panels[-1].set_xlabel("Frame")
        if title:
            panels[0].set_title(plain_text(title), weight="bold")
        return figure


def _draw_light(grey: "Axes", spread: "Axes", light: "pd.DataFrame") -> None:
    for axes, columns, label in (
        (grey, ("luminance", "target_luminance"), "Mean grey\nlevel"),
        (spread, ("unevenness", "target_unevenness"), "Unevenness\n(stops)"),
    ):
        for column, color, name in zip(
            columns, (BLUE, ORANGE), ("frame", "around the target"), strict=True
        ):
            # with points, for a line shows none of the target's where only key frames have truth
            axes.plot(
                light.frame, light[column], ".-", ms=2.2, color=color, linewidth=1, label=name
            )
        axes.set_ylabel(label, fontsize=7)
        axes.set_ylim(bottom=0)
        axes.grid(axis="y")
    grey.legend(loc="upper left", bbox_to_anchor=(1.005, 1.0), borderaxespad=0, fontsize=6.5)


def _draw_bands(axes: "Axes", bands: Sequence[LossBand], looks: Mapping[str, Look]) -> None:
    from matplotlib.colors import to_rgb

    for row, band in enumerate(bands):
        look = looks[band.run]
        color = np.array(to_rgb(look.color))
        known = np.isfinite(band.overlap)
        strength = np.where(known & ~band.lost, 0.12 + 0.88 * np.nan_to_num(band.overlap), 0.0)
        strength[~known] = _UNKNOWN
        edges = _edges(band.frames)
        for start, end, value in _stretches(edges, strength):
            shade = (0.85,) * 3 if value == _UNKNOWN else tuple(1 - value * (1 - color))
            axes.fill_between((start, end), row - 0.38, row + 0.38, color=shade, linewidth=0)
        axes.plot(
            (edges[0], edges[-1], edges[-1], edges[0], edges[0]),
            (row - 0.38, row - 0.38, row + 0.38, row + 0.38, row - 0.38),
            color=look.color,
            linestyle=look.line,
            linewidth=0.5,
        )
        if band.first_loss is not None:
            axes.plot(band.first_loss, row, "x", color=VERMILION, markersize=4.5, mew=1.3)
    axes.set_yticks(
        range(len(bands)), [shortened(looks[band.run].label, _LETTERS) for band in bands]
    )
    axes.tick_params(axis="y", labelsize=5.5, length=0)
    axes.set_ylim(len(bands) - 0.4, -0.6)
    first = min((int(band.frames[0]) for band in bands), default=0)
    last = max((int(band.frames[-1]) for band in bands), default=1)
    axes.set_xlim(first - 1, last + 1)
    for side in ("left", "top", "right"):
        axes.spines[side].set_visible(False)


def _edges(frames: npt.NDArray[np.intp]) -> npt.NDArray[np.float64]:
    """Where the stretch of each frame begins, and the last one ends."""
    middle = (frames[1:] + frames[:-1]) / 2
    return np.concatenate([[frames[0] - 0.5], middle, [frames[-1] + 0.5]])


def _stretches(
    edges: npt.NDArray[np.float64], values: npt.NDArray[np.float64]
) -> list[tuple[float, float, float]]:
    """Start, end and value of stretches of one value, in sixteen steps, so that they are few."""
    steps = np.round(values * 16) / 16
    changes = np.flatnonzero(steps[1:] != steps[:-1]) + 1
    starts = np.concatenate([[0], changes])
    ends = np.concatenate([changes, [len(steps)]])
    return [
        (float(edges[start]), float(edges[end]), float(steps[start]))
        for start, end in zip(starts, ends, strict=True)
    ]
