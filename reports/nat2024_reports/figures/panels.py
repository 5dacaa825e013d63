"""Axes and legends at fixed places, in inches, so that no label moves or squeezes a plot."""

from typing import TYPE_CHECKING

from nat2024_reports.style import new_figure, plain_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LINE = 0.128
"""Height of a line of a legend."""

TITLE = 0.2
"""Height that a title over all panels takes."""

_LEAST_SIZE, _SIZE = 4.5, 6.5  # points of letters in legends
_EDGE = 0.06
_BELOW, _ABOVE = 0.42, 0.2  # of axes: ticks and label, title


def panels(
    count: int,
    *,
    width: float,
    height: float,
    entries: int,
    title: str = "",
    left: float = 0.48,
    headings: bool = True,
) -> "tuple[Figure, list[Axes]]":
    """A row of axes with room for a legend below each.

    Args:
        count: of axes, at least one.
        width: of the figure in inches.
        height: of the axes in inches.
        entries: lines of the longest legend.
        title: over all, may be empty.
        left: room for the ticks and the label of each, in inches.
        headings: whether each has a title of its own.
    """
    legend = entries * LINE + (0.08 if entries else 0)
    above = (_ABOVE if headings else 0.04) + (TITLE if title else 0)
    whole = height + _BELOW + legend + above + _EDGE
    figure = new_figure(width, whole)
    figure.set_layout_engine("none")
    figure.set_dpi(400)  # legends are measured; coarse pixels would round up their lines
    cell = width / count
    made = []
    for number in range(count):
        corner = (number * cell + left) / width, (legend + _BELOW + _EDGE) / whole
        size = (cell - left - 0.14) / width, height / whole
        made.append(figure.add_axes((*corner, *size)))
    if title:
        figure.suptitle(plain_text(title), fontsize=8, weight="bold", y=1 - 0.05 / whole, va="top")
    return figure, made


def legend_below(axes: "Axes", *, columns: int = 1) -> None:
    """A legend under axes made by `panels`, in letters as large as fit into their cell.

    Args:
        axes: with labelled lines.
        columns: side by side.
    """
    figure = axes.figure
    bounds = axes.get_position()
    width, height = figure.get_size_inches()  # type: ignore[union-attr]
    cells = len(figure.axes)
    cell = width / cells
    left = int(bounds.x0 * cells + 1e-9) * cell + _EDGE
    top = bounds.y0 * height - _BELOW - 0.02
    legend_at(axes, (left, top), cell - 2 * _EDGE, columns=columns)


def legend_at(axes: "Axes", place: tuple[float, float], room: float, *, columns: int = 1) -> None:
    """A legend at a place, in letters as large as fit, its lines `LINE` apart.

    Args:
        axes: with labelled lines.
        place: top left corner, inches from the lower left corner of the figure.
        room: width in inches.
        columns: side by side.
    """
    figure = axes.figure
    size, spacing = _SIZE, 0.3
    for _ in range(3):  # letters that fit the room, then lines of the height that was reserved
        legend = axes.legend(
            loc="upper left",
            bbox_to_anchor=place,
            bbox_transform=figure.dpi_scale_trans,
            ncols=columns,
            borderaxespad=0.0,
            borderpad=0.0,
            handlelength=2.6,
            labelspacing=spacing,
            columnspacing=1.2,
            fontsize=size,
        )
        extent = legend.get_window_extent()
        wide, tall = extent.width / figure.dpi, extent.height / figure.dpi
        lines = -(-len(legend.get_texts()) // columns)
        size = max(_LEAST_SIZE, size * min(1.0, room / wide))
        if lines > 1:  # spacing counts in sizes of letters, which are 1/72 inch
            spacing = max(0.0, spacing + (LINE * (lines - 0.2) - tall) / (lines - 1) * 72 / size)
