"""Figures of one tracked sequence."""

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from nat2024_reports.style import COLUMN, GREY, VERMILION, figure_style, new_figure

if TYPE_CHECKING:
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
