"""Success against light level."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from nat2024_reports.figures.looks import Look
from nat2024_reports.figures.panels import legend_below, panels
from nat2024_reports.style import COLUMN, figure_style

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

DAY = 1.0
"""The level that stands for the daytime dataset itself; its own light is not known."""


def light_levels_figure(
    table: "pd.DataFrame", looks: Mapping[str, Look], *, score: str = "Success (AUC)"
) -> "Figure":
    """A score of each run against the light that the same sequences were darkened to.

    The axis of light is logarithmic, as eyes and exposures count; daylight stands apart at its end.

    Args:
        table: `level, run, value`, levels as mean grey 0..1, `DAY` for the daytime dataset.
        looks: by run.
        score: label of the values.
    """
    levels = sorted({float(level) for level in table.level})
    dark = [level for level in levels if level < DAY]
    runs = list(dict.fromkeys(table.run))
    places = {level: float(np.log2(level)) for level in dark}
    places[DAY] = max(places.values(), default=0.0) + 0.8
    with figure_style():
        columns = 2 if len(runs) > 3 else 1
        entries = -(-len(runs) // columns)
        figure, (axes,) = panels(1, width=COLUMN, height=1.7, entries=entries, headings=False)
        for run in runs:
            _line(axes, table[table.run == run].sort_values("level"), places, looks[run])
        axes.set_xticks(
            [places[level] for level in levels],
            ["day" if level == DAY else f"{level:g}" for level in levels],
        )
        axes.set(xlabel="Mean grey level of the first frame (0-1)", ylabel=score)
        axes.set_ylim(0, max(1.08 * float(table.value.max()), 0.1))
        axes.grid()
        legend_below(axes, columns=columns)
        return figure


def _line(axes: "Axes", rows: "pd.DataFrame", places: Mapping[float, float], look: Look) -> None:
    x = np.array([places[float(level)] for level in rows.level])
    y = rows.value.to_numpy(dtype=np.float64)
    is_dark = rows.level.to_numpy() < DAY
    face = "white" if look.is_dashed else look.color
    axes.plot(
        x[is_dark],
        y[is_dark],
        linestyle=look.line,
        color=look.color,
        linewidth=1.2,
        marker=look.marker or "o",
        markersize=4,
        markerfacecolor=face,
        label=look.label,
    )
    axes.plot(x[~is_dark], y[~is_dark], look.marker or "o", color=look.color, mfc=face, ms=4)
