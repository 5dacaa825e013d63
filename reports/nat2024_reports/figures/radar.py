"""Radar of scores by attribute or category."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from nat2024_reports.figures.looks import Look
from nat2024_reports.figures.panels import LINE, TITLE, legend_at
from nat2024_reports.style import COLUMN, figure_style, new_figure, plain_text, shortened

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

LEAST, MOST = 3, 16
"""Axes that a radar needs, and that it can have before their names run into each other."""

_SIDE = 2.0  # inches, of the square that holds the rings


def radar_figure(table: "pd.DataFrame", looks: Mapping[str, Look], *, title: str = "") -> "Figure":
    """One closed line a run over the axes, which start in the middle at 0.

    Args:
        table: `label, run, value`; a row with NaN leaves a gap in its line.
        looks: by run.
        title: above, may be empty.
    """
    labels = list(dict.fromkeys(table.label))
    runs = list(dict.fromkeys(table.run))
    angles = 2 * np.pi * np.arange(len(labels)) / max(len(labels), 1)
    columns = 2 if len(runs) > 3 else 1
    legend = -(-len(runs) // columns) * LINE + 0.1
    height = legend + _SIDE + 0.72 + (TITLE if title else 0)
    with figure_style():
        figure = new_figure(COLUMN, height)
        figure.set_layout_engine("none")
        figure.set_dpi(400)  # the legend is measured; coarse pixels would round up its lines
        corner = (COLUMN - _SIDE) / 2 / COLUMN, (legend + 0.36) / height
        size = _SIDE / COLUMN, _SIDE / height
        axes: Any = figure.add_axes((*corner, *size), projection="polar")
        axes.set_theta_zero_location("N")
        axes.set_theta_direction(-1)
        for place, run in enumerate(runs):
            look = looks[run]
            values = table[table.run == run].set_index("label").value.reindex(labels).to_numpy()
            axes.plot(
                np.append(angles, angles[:1]),
                np.append(values, values[:1]),
                linestyle=look.line,
                color=look.color,
                linewidth=1.2,
                marker=look.marker or None,
                markersize=3,
                label=look.label,
                zorder=3 - 0.01 * place,
            )
        top = _top(table.value.max())
        axes.set_ylim(0, top)
        _rings(axes, top, np.pi / max(len(labels), 1))
        axes.set_xticks(angles, [_two_lines(label) for label in labels])
        axes.tick_params(axis="x", pad=1, labelsize=7 if len(labels) <= 10 else 6)
        for text, angle in zip(axes.get_xticklabels(), angles, strict=True):
            side = round(float(np.sin(angle)), 3)
            text.set_horizontalalignment("center" if side == 0 else "left" if side > 0 else "right")
        axes.spines["polar"].set_visible(False)
        axes.grid(visible=True)
        if title:
            top = 1 - 0.05 / height
            figure.suptitle(plain_text(title), fontsize=8, weight="bold", y=top, va="top")
        legend_at(axes, (0.06, legend), COLUMN - 0.12, columns=columns)
        return figure


def _two_lines(label: str) -> str:
    """`traffic sign (6)` with a line a word, so that names at the sides stay on the page."""
    name, space, count = label.rpartition(" (")
    words = [plain_text(shortened(word, 11)) for word in (name if space else label).split(" ")]
    return "\n".join([*words, *([f"({plain_text(count)}"] if space else [])])


def _rings(axes: Any, top: float, angle: float) -> None:
    """Rings with their numbers, which lie over the lines."""
    step = 0.2 if top > 0.5 else 0.1 if top > 0.2 else 0.05
    rings = step * np.arange(1, round(top / step + 1e-9) + 1)
    axes.set_yticks(rings, [""] * len(rings))
    behind = {"facecolor": "white", "edgecolor": "none", "pad": 0.5, "alpha": 0.75}
    style: dict[str, Any] = {"ha": "center", "va": "center", "fontsize": 6, "color": "#444444"}
    for ring in rings:
        axes.text(angle, ring, f"{ring:.2g}", bbox=behind, zorder=5, **style)


def _top(highest: float) -> float:
    """The next ring outside."""
    if not np.isfinite(highest):
        return 1.0
    step = 0.2 if highest > 0.5 else 0.1
    return float(max(np.ceil(highest / step - 1e-9) * step, 0.1))
