"""Figures of enhanced images: contact sheets, strips with insets, maps; arrays in, figures out."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from nat2024_reports.style import (
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PAGE,
    VERMILION,
    figure_style,
    new_figure,
    plain_text,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Pixels = npt.NDArray[np.uint8]
"""uint8 (H, W, 3) RGB."""

INSET_COLOURS = (VERMILION, "#56B4E9", ORANGE, GREEN, BLUE)
_LINE = 0.13  # inches that a line of small letters takes
_GAP = 0.04
_MARGIN = 0.05
_CELL = 1.5  # inches, the least width of a column
_FLAT, _TALL = 0.15, 1.5  # cells are no flatter and no taller by their width
_PANEL_PIXELS = 400
_OUTLIER = 1.25  # values further out than the usual ones by this do not stretch the scale
_BAR = 0.6


@dataclass(frozen=True, slots=True)
class SheetRow:
    """One row of a contact sheet.

    Attributes:
        name: of the image.
        images: of the input and each enhancer, in the order of the columns; None where an
            enhancer made nothing of it.
    """

    name: str
    images: Sequence[Pixels | None]


def contact_sheet(columns: Sequence[str], rows: Sequence[SheetRow]) -> "Figure":
    """Images side by side: a row an image, a column the input or an enhancer.

    Args:
        columns: headings.
        rows: reduced as far as wanted; sides of an image stay in proportion.
    """
    width = max(_CELL, (PAGE - 2 * _MARGIN) / max(len(columns), 2) - _GAP)
    heights = [width * _aspect(row.images) for row in rows]
    total = (len(columns) * (width + _GAP) - _GAP) + 2 * _MARGIN
    whole = sum(heights) + len(rows) * (_LINE + _GAP) + 1.4 * _LINE + _MARGIN
    with figure_style():
        figure = _bare_figure(total, whole)
        place = _Places(figure, total, whole)
        for number, label in enumerate(columns):
            centre = _MARGIN + number * (width + _GAP) + width / 2
            place.text(centre, 0.7 * _LINE, label, ha="center", va="center", weight="bold")
        top = 1.4 * _LINE
        for row, height in zip(rows, heights, strict=True):
            place.text(_MARGIN, top + 0.5 * _LINE, row.name, va="center", fontsize=6, color=GREY)
            top += _LINE
            for number, image in enumerate(row.images):
                left = _MARGIN + number * (width + _GAP)
                _cell(place.axes(left, top, width, height), image)
            top += height + _GAP
        return figure


def comparison_strip(
    columns: Sequence[str],
    images: Sequence[Pixels],
    insets: Sequence[tuple[int, int, int, int]],
) -> "Figure":
    """One image before and after each enhancer, with the same parts of it enlarged below.

    Args:
        columns: headings.
        images: of the input and each enhancer, all of one size.
        insets: x, y, w, h in pixels; each has a colour of its own.
    """
    width = max(_CELL, (PAGE - 2 * _MARGIN) / max(len(columns), 2) - _GAP)
    height = width * _aspect(images)
    part = (width - _GAP * (len(insets) - 1)) / max(len(insets), 1)
    below = max((part * min(max(h / w, _FLAT), _TALL) for _, _, w, h in insets), default=0.0)
    total = (len(columns) * (width + _GAP) - _GAP) + 2 * _MARGIN
    whole = 1.4 * _LINE + height + (_GAP + below if insets else 0) + _MARGIN
    with figure_style():
        figure = _bare_figure(total, whole)
        place = _Places(figure, total, whole)
        for number, (label, image) in enumerate(zip(columns, images, strict=True)):
            left = _MARGIN + number * (width + _GAP)
            place.text(
                left + width / 2, 0.7 * _LINE, label, ha="center", va="center", weight="bold"
            )
            axes = place.axes(left, 1.4 * _LINE, width, height)
            _cell(axes, image)
            for order, inset in enumerate(insets):
                colour = INSET_COLOURS[order % len(INSET_COLOURS)]
                _frame(axes, inset, colour)
                corner = left + order * (part + _GAP)
                top = 1.4 * _LINE + height + _GAP
                _enlarge(place.axes(corner, top, part, below), image, inset, colour)
        return figure


def maps_figure(title: str, values: npt.NDArray[np.float32], order: str = "RGB") -> "Figure":
    """The channels of one map, all on one colour scale that the bar states.

    Maps with values below 0 are coloured around 0 (blue below, red above), all others from 0 up.
    Where few values lie far out, the scale ends at the 99.5th percentile and the bar has arrows.
    A map of three channels without negative values is also shown as a picture, divided by the end
    of the scale. Channels in multiples of three are taken for iterations of three colours.

    Args:
        title: name of the map.
        values: (channels, h, w).
        order: colours of three channels, "RGB" or "BGR".
    """
    values = np.nan_to_num(np.asarray(values, dtype=np.float32))
    signed = bool((values < 0).any())
    most = float(np.abs(values).max(initial=0.0)) or 1.0
    usual = float(np.percentile(np.abs(values), 99.5))
    limit = usual if most > _OUTLIER * usual > 0 else most
    panels, columns = _panels(values, order, signed=signed, limit=limit)
    rows = -(-len(panels) // columns)
    aspect = min(max(values.shape[-2] / values.shape[-1], _FLAT), _TALL)
    width = (PAGE - 2 * _MARGIN - _BAR) / max(columns, 3) - _GAP
    height = width * aspect
    total = 2 * _MARGIN + columns * (width + _GAP) + _BAR
    total = max(total, 3.6)
    whole = 1.6 * _LINE + rows * (height + _LINE + _GAP) + _MARGIN
    scale: dict[str, Any] = {"vmin": -limit if signed else 0.0, "vmax": limit}
    scale["cmap"] = "RdBu_r" if signed else "viridis"
    with figure_style():
        figure = _bare_figure(total, whole)
        place = _Places(figure, total, whole)
        words = f"{title}: {values.min():.4g} to {values.max():.4g}"
        words += ", coloured around 0" if signed else ", coloured from 0"
        place.text(_MARGIN, 0.8 * _LINE, words, va="center", weight="bold")
        shown: Any = None
        for number, (label, panel) in enumerate(panels):
            left = _MARGIN + number % columns * (width + _GAP)
            top = 1.6 * _LINE + number // columns * (height + _LINE + _GAP)
            place.text(left, top + 0.5 * _LINE, label, va="center", fontsize=6, color=GREY)
            axes = place.axes(left, top + _LINE, width, height)
            axes.set_axis_off()
            drawn = axes.imshow(panel, **({} if panel.ndim == 3 else scale))
            shown = shown if panel.ndim == 3 else drawn
        left = _MARGIN + columns * (width + _GAP)
        tall = min(whole - 2.9 * _LINE - _MARGIN, 2.5)
        bar = figure.colorbar(
            shown,
            cax=place.axes(left + 0.04, 2.6 * _LINE, 0.1, tall),
            extend=("both" if signed else "max") if most > limit else "neither",
        )
        bar.outline.set_visible(False)
        bar.ax.tick_params(labelsize=6, length=2)
        return figure


def _panels(
    values: npt.NDArray[np.float32], order: str, *, signed: bool, limit: float
) -> tuple[list[tuple[str, npt.NDArray[np.float32]]], int]:
    """Labels with what they show, and the number of columns."""
    small = _reduced(values)
    labels = channel_labels(len(values), order)
    single = list(zip(labels, small, strict=True))
    if len(values) == 3:
        if signed:
            return single, 3
        picture = small.transpose(1, 2, 0) / limit
        picture = picture if order == "RGB" else picture[..., ::-1]
        return [(f"as a picture, white is {limit:.3g}", picture.clip(0, 1)), *single], 4
    if len(values) % 3 == 0:  # a row a colour, a column an iteration
        turns = len(values) // 3
        by_colour = [single[3 * turn + colour] for colour in range(3) for turn in range(turns)]
        return by_colour, turns
    return single, min(len(values), 4)


def channel_labels(count: int, order: str = "RGB") -> list[str]:
    """What the channels of a map are called: colours, iterations of colours, or numbers."""
    names = [{"R": "red", "G": "green", "B": "blue"}[letter] for letter in order]
    if count == 3:
        return names
    if count % 3 == 0:
        return [f"{names[c % 3]}, iteration {c // 3 + 1}" for c in range(count)]
    return [f"channel {c + 1}" for c in range(count)]


def _reduced(values: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """Means over blocks, so that no panel has many more pixels than it is drawn with."""
    block = -(-max(values.shape[1:]) // _PANEL_PIXELS)
    height, width = (max(1, side // block) for side in values.shape[1:])
    tall, wide = min(block, values.shape[1]), min(block, values.shape[2])
    cut = values[:, : height * tall, : width * wide]
    means: npt.NDArray[np.float32] = cut.reshape(-1, height, tall, width, wide).mean(axis=(2, 4))
    return means


def _bare_figure(width: float, height: float) -> "Figure":
    figure = new_figure(width, height)
    figure.set_layout_engine("none")
    return figure


@dataclass(frozen=True, slots=True)
class _Places:
    """Where things go in a figure, in inches from its top left corner."""

    figure: "Figure"
    width: float
    height: float

    def axes(self, left: float, top: float, width: float, height: float) -> "Axes":
        """Axes of this place and size."""
        bottom = 1 - (top + height) / self.height
        size = (left / self.width, bottom, width / self.width, height / self.height)
        return self.figure.add_axes(size)

    def text(self, left: float, top: float, words: str, **style: Any) -> None:
        """Words that are taken as they are, whatever signs are in them."""
        place = (left / self.width, 1 - top / self.height)
        self.figure.text(*place, plain_text(words), **{"fontsize": 7, **style})


def _aspect(images: Sequence[Pixels | None]) -> float:
    there = next((image for image in images if image is not None), None)
    if there is None:
        return 0.5
    return float(min(max(there.shape[0] / there.shape[1], _FLAT), _TALL))


def _cell(axes: "Axes", image: Pixels | None) -> None:
    axes.set_axis_off()
    if image is None:
        style: dict[str, Any] = {"ha": "center", "va": "center", "color": GREY, "fontsize": 7}
        axes.text(0.5, 0.5, "failed", transform=axes.transAxes, **style)
        return
    axes.imshow(image, interpolation="antialiased")


def _frame(axes: "Axes", inset: tuple[int, int, int, int], colour: str) -> None:
    from matplotlib.patches import Rectangle

    x, y, w, h = inset
    # pixels reach half a pixel to each side of their centres
    axes.add_patch(Rectangle((x - 0.5, y - 0.5), w, h, fill=False, edgecolor=colour, linewidth=1.0))


def _enlarge(axes: "Axes", image: Pixels, inset: tuple[int, int, int, int], colour: str) -> None:
    x, y, w, h = inset
    axes.imshow(image[y : y + h, x : x + w], interpolation="bicubic")
    axes.set_xticks([])
    axes.set_yticks([])
    for spine in axes.spines.values():
        spine.set_visible(True)
        spine.set_color(colour)
        spine.set_linewidth(1.6)
