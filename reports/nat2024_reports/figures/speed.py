"""Speed against success."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from nat2024_reports.figures.looks import Look, NamedRun
from nat2024_reports.style import BLACK, GREY, PAGE, figure_style, new_figure, plain_text, shortened

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

REAL_TIME = 30.0
"""Frames a second from which a tracker keeps up with an ordinary camera."""


def speed_figure(
    table: "pd.DataFrame",
    runs: Mapping[str, NamedRun],
    looks: Mapping[str, Look],
    *,
    score: str = "Success (AUC)",
) -> "Figure":
    """A score of each run against its frames a second, on a logarithmic axis.

    Colours tell trackers and shapes enhancers; trackers alone are hollow, and a thin line leads
    from each to what enhancers make of it.

    Args:
        table: `run, frames_per_second, value`.
        runs: names by run.
        looks: by run, with colours of trackers.
        score: label of the values.
    """
    places: dict[str, tuple[float, float]] = {
        str(row["run"]): (float(row["frames_per_second"]), float(row["value"]))
        for row in table.to_dict(orient="records")
    }
    plain = {runs[run].tracker: place for run, place in places.items() if runs[run].is_plain}
    with figure_style():
        figure = new_figure(0.72 * PAGE, 2.6)
        axes = figure.add_subplot()
        for run, place in places.items():
            if not runs[run].is_plain and runs[run].tracker in plain:
                ends = np.array([plain[runs[run].tracker], place])
                axes.plot(*ends.T, color=looks[run].color, linewidth=0.5, alpha=0.6, zorder=1)
        for run, place in places.items():
            _point(axes, place, looks[run].color, looks[run].shape, hollow=runs[run].is_plain)
        _axis_of_speed(axes, [speed for speed, _ in places.values()])
        axes.set_ylabel(score)
        axes.margins(y=0.12)
        axes.grid()
        shown = [(runs[run], looks[run]) for run in places]
        handles = [_handle(look.color, "s", one.tracker) for one, look in _once(shown, "tracker")]
        for one, look in _once(shown, "enhancer"):
            name = "no enhancer" if one.is_plain else one.enhancer
            handles.append(_handle(BLACK, look.shape, name, hollow=one.is_plain))
        axes.legend(handles=handles, loc="upper left", bbox_to_anchor=(1.02, 1.0), borderaxespad=0)
        return figure


def _once(shown: "list[tuple[NamedRun, Look]]", key: str) -> "list[tuple[NamedRun, Look]]":
    """The first of each tracker or enhancer."""
    first: dict[str, tuple[NamedRun, Look]] = {}
    for run, look in shown:
        first.setdefault(getattr(run, key), (run, look))
    return list(first.values())


def _point(
    axes: "Axes", place: tuple[float, float], color: str, shape: str, *, hollow: bool
) -> None:
    face = "white" if hollow else color
    axes.plot(*place, shape, color=color, markerfacecolor=face, markersize=5.5, zorder=2)


def _handle(color: str, shape: str, name: str, *, hollow: bool = False) -> Any:
    from matplotlib.lines import Line2D

    face = "white" if hollow else color
    label = plain_text(shortened(name, 30))
    return Line2D([], [], ls="", color=color, marker=shape, mfc=face, ms=5, label=label)


def _axis_of_speed(axes: "Axes", speeds: list[float]) -> None:
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axes.set_xscale("log")
    low, high = min(speeds, default=1.0) / 1.3, max(speeds, default=100.0) * 1.3
    axes.set_xlim(low, high)
    wide = high / low > 300
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0,) if wide else (1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_xlabel("Frames per second (enhancing and tracking)")
    if low < REAL_TIME < high:
        axes.axvline(REAL_TIME, color=GREY, linewidth=0.8, linestyle="--", zorder=0)
        axes.annotate(
            f"{REAL_TIME:g} frames/s",
            (REAL_TIME, 1.0),
            (2, 0),
            xycoords=("data", "axes fraction"),
            textcoords="offset points",
            fontsize=6,
            color=GREY,
        )
