"""Centre location error over the frames of a sequence."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from nat2024_reports.figures.looks import Look
from nat2024_reports.figures.panels import legend_below, panels
from nat2024_reports.style import COLUMN, GREY, VERMILION, figure_style, new_figure

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LIMIT = 20
"""Pixels within which a centre counts as found, as in precision."""


def center_error_figure(
    frames: npt.NDArray[np.int64], errors: npt.NDArray[np.float64], label: str
) -> "Figure":
    """Centre location error over the frames with its 20-pixel line.

    Args:
        frames: numbers of the frames.
        errors: pixels, NaN where no reference is known.
        label: of the run.
    """
    with figure_style():
        figure = new_figure(COLUMN, 1.8)
        axes = figure.add_subplot()
        axes.plot(frames, errors, color=VERMILION, linewidth=1, label=label)
        alone = _alone(errors)  # a line shows no single points, such as key frames
        axes.plot(frames[alone], errors[alone], ".", color=VERMILION, markersize=4)
        axes.axhline(LIMIT, color=GREY, linewidth=0.8, linestyle="--", label=f"{LIMIT} px")
        highest = np.nanmax(errors) if np.isfinite(errors).any() else 0.0
        axes.set(xlabel="Frame", ylabel="Centre location error (px)")
        axes.set_ylim(0, max(2 * LIMIT, 1.05 * float(highest)))
        axes.legend(loc="upper left", ncols=2)
    return figure


def _alone(errors: npt.NDArray[np.float64]) -> npt.NDArray[np.bool_]:
    """Which frames have an error while neither neighbour has one."""
    known = np.pad(np.isfinite(errors), 1)
    alone: npt.NDArray[np.bool_] = known[1:-1] & ~known[:-2] & ~known[2:]
    return alone


def center_errors_figure(
    table: "pd.DataFrame", looks: Mapping[str, Look], *, title: str = ""
) -> "Figure":
    """Centre location error of several runs over the frames of one sequence.

    The axis is linear up to the limit, the share of it that precision counts, and logarithmic
    beyond, so that a lost target does not flatten all others.

    Args:
        table: `frame, run, error`, errors in pixels, NaN where none is known.
        looks: by run.
        title: above, may be empty.
    """
    runs = list(dict.fromkeys(table.run))
    with figure_style():
        columns = 2 if len(runs) > 3 else 1
        entries = -(-len(runs) // columns)
        figure, (axes,) = panels(
            1, width=COLUMN, height=1.6, entries=entries, title=title, left=0.56, headings=False
        )
        for run in runs:
            rows, look = table[table.run == run], looks[run]
            frames, errors = rows.frame.to_numpy(), rows.error.to_numpy(dtype=np.float64)
            axes.plot(
                frames, errors, linestyle=look.line, color=look.color, lw=0.9, label=look.label
            )
            alone = _alone(errors)
            face = "white" if look.is_dashed else look.color
            points: dict[str, Any] = {
                "color": look.color,
                "markerfacecolor": face,
                "markersize": 2.5,
            }
            axes.plot(frames[alone], errors[alone], "o", **points)
        _limit_scale(axes, float(table.error.max()))
        axes.set(xlabel="Frame", ylabel="Centre location error (px)")
        axes.margins(x=0.01)
        legend_below(axes, columns=columns)
        return figure


def _limit_scale(axes: "Axes", highest: float) -> None:
    from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

    axes.axhline(LIMIT, color=GREY, linewidth=0.9, linestyle="--", zorder=1)
    axes.set_yscale("symlog", linthresh=LIMIT, linscale=1.0)
    top = max(2.5 * LIMIT, 1.15 * highest) if np.isfinite(highest) else 2.5 * LIMIT
    axes.set_ylim(0, top)
    ticks = [0, LIMIT // 2, LIMIT, 50, 100, 200, 500, 1000, 2000, 5000]
    axes.yaxis.set_major_locator(FixedLocator([tick for tick in ticks if tick <= top]))
    axes.yaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.grid(axis="y")
