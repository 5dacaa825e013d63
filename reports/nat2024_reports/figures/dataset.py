"""Figures that describe a dataset; tables and arrays in, figures out."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from nat2024_reports.style import (
    BLUE,
    COLUMN,
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
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_NAMED_BARS = 40
"""Up to so many sequences, each has a bar with its name; beyond, a histogram is drawn."""

_SHEET_COLUMNS, _SHEET_ROWS = 5, 8


@dataclass(frozen=True, slots=True)
class FirstFrame:
    """One picture of the contact sheet.

    Attributes:
        name: of the sequence.
        image: uint8 (H, W, 3) RGB, reduced as far as wanted.
        box: x, y, w, h in pixels of `image`, None without annotation.
    """

    name: str
    image: npt.NDArray[np.uint8]
    box: tuple[float, float, float, float] | None


def length_figure(lengths: "pd.Series[Any]") -> "Figure":
    """Frames of each sequence: named bars, or a histogram where there are many.

    Args:
        lengths: by name of the sequence.
    """
    from matplotlib.ticker import MaxNLocator

    with figure_style():
        if len(lengths) > _NAMED_BARS:
            figure = new_figure(COLUMN, 2.4)
            axes = figure.add_subplot()
            _histogram(axes, _numbers(lengths), "Frames of a sequence", color=BLUE, percent=False)
            axes.set_ylabel("Sequences")
            axes.yaxis.set_major_locator(MaxNLocator(6, integer=True))
            return figure
        figure = new_figure(COLUMN, max(1.2, 0.17 * len(lengths) + 0.6))
        axes = figure.add_subplot()
        ordered = lengths.sort_values(kind="stable")
        axes.barh(np.arange(len(ordered)), ordered.to_numpy(), color=BLUE, height=0.7)
        axes.set_yticks(np.arange(len(ordered)), [plain_text(name) for name in ordered.index])
        axes.tick_params(axis="y", length=0)
        axes.set_xlabel("Frames")
        axes.grid(axis="x")
        return figure


def motion_figure(
    boxes: "pd.DataFrame", *, small_area: float, fast_step: float, relative: bool = False
) -> "Figure":
    """Sizes of the boxes and their motion from frame to frame, three histograms.

    Args:
        boxes: columns `size`, `step`, `relative_step`; sizes are square roots of areas.
        small_area: area in pixels below which a target is small, shown as a line.
        fast_step: step above which motion is fast, shown as a line.
        relative: whether `fast_step` is in sizes of the box.
    """
    with figure_style():
        figure = new_figure(PAGE, 2.1)
        figure.set_layout_engine("constrained", w_pad=0.08)
        size, step, ratio = figure.subplots(1, 3)
        _log_histogram(size, boxes["size"], "Size of the box, $\\sqrt{wh}$ (pixels)", BLUE)
        _mark(size, float(np.sqrt(small_area)), f"area {small_area:g}")
        _log_histogram(step, boxes.step, "Step of the centre (pixels)", GREEN)
        _log_histogram(ratio, boxes.relative_step, "Step / size of the box", ORANGE)
        _mark(ratio if relative else step, fast_step, "fast")
        size.set_ylabel("Frames (%)")
        return figure


def place_figure(heat_map: npt.NDArray[np.float64], aspect: float = 16 / 9) -> "Figure":
    """Where in the frame the centres of the boxes lie.

    Args:
        heat_map: (rows, columns), share of the centres by cell of the frame.
        aspect: width / height of the frames.
    """
    with figure_style():
        figure = new_figure(COLUMN, (COLUMN - 1.0) / max(aspect, 0.5) + 0.5)
        axes = figure.add_subplot()
        extent = (0.0, 1.0, 1.0, 0.0)
        shown = axes.imshow(100 * heat_map, extent=extent, aspect=1 / aspect, vmin=0)
        axes.set_xlabel("x / width")
        axes.set_ylabel("y / height")
        for spine in axes.spines.values():
            spine.set_visible(False)
        beside = axes.inset_axes((1.03, 0.0, 0.04, 1.0))
        bar = figure.colorbar(shown, cax=beside, label="Centres (%)")
        bar.outline.set_visible(False)
        return figure


def light_figure(light: "pd.DataFrame", *, uneven_light: float) -> "Figure":
    """How bright frames are, and how unevenly they and the surroundings of targets are lit.

    Args:
        light: columns `sequence`, `mean` (0..1), `spread` and `target_spread` (stops).
        uneven_light: spread from which light is uneven, shown as a line.
    """
    with figure_style():
        figure = new_figure(PAGE, 2.2)
        figure.set_layout_engine("constrained", w_pad=0.08)
        mean, spread, both = figure.subplots(1, 3)
        _histogram(mean, 255 * _numbers(light["mean"]), "Mean grey level (0-255)", BLUE)
        mean.set_ylabel("Frames (%)")
        parts = (("frame", light.spread, BLUE), ("around target", light.target_spread, ORANGE))
        edges = _edges(np.concatenate([_numbers(part) for _, part, _ in parts]))
        for name, values, color in parts:
            _outline(spread, _numbers(values), edges, color, name)
        _mark(spread, uneven_light, "")
        spread.set_xlabel("Spread of light (stops)")
        spread.margins(y=0.25)
        spread.legend(handlelength=1.2, borderaxespad=0.1)
        means = light.groupby("sequence")[["mean", "spread"]].mean()
        both.scatter(255 * means["mean"], means.spread, s=14, color=BLUE, alpha=0.7, linewidths=0)
        both.axhline(uneven_light, color=VERMILION, linestyle="--", linewidth=1)
        both.set_xlabel("Mean grey level of a sequence")
        both.set_ylabel("Spread of light (stops)")
        both.set_ylim(bottom=0)
        both.set_xlim(left=0)
        both.grid()
        return figure


def co_occurrence_figure(counts: "pd.DataFrame") -> "Figure":
    """How many sequences carry two attributes at once; the diagonal counts each attribute.

    Args:
        counts: square, index and columns are the names of the attributes.
    """
    with figure_style():
        number = len(counts)
        side = min(PAGE, 0.32 * number + 1.6)
        figure = new_figure(side, side)
        axes = figure.add_subplot()
        values = np.asarray(counts, dtype=np.float64)
        most = max(values.max(initial=0), 1)
        axes.imshow(values, cmap="Blues", vmin=0, vmax=1.15 * most)
        size = 7 if number <= 16 else 5
        for row, column in np.ndindex(*values.shape):
            light = values[row, column] > 0.6 * most
            text: dict[str, Any] = {"color": "white" if light else "black", "fontsize": size}
            axes.text(column, row, f"{values[row, column]:g}", ha="center", va="center", **text)
        names = [str(name) for name in counts.index]
        axes.set_xticks(np.arange(number), names, rotation=90)
        axes.set_yticks(np.arange(number), names)
        axes.tick_params(length=0)
        for spine in axes.spines.values():
            spine.set_visible(False)
        return figure


def contact_sheets(frames: Sequence[FirstFrame]) -> "list[Figure]":
    """First frames with the box of the target in red, 40 on a page, in the order given."""
    page = _SHEET_COLUMNS * _SHEET_ROWS
    return [_contact_sheet(frames[start : start + page]) for start in range(0, len(frames), page)]


def _contact_sheet(frames: Sequence[FirstFrame]) -> "Figure":
    from matplotlib.patches import Rectangle

    columns = _sheet_columns(len(frames))
    rows = -(-len(frames) // columns)
    width = PAGE / max(columns, 3)
    shape = np.median([frame.image.shape[0] / frame.image.shape[1] for frame in frames])
    with figure_style():
        figure = new_figure(width * columns, (width * float(shape) + 0.17) * rows)
        figure.set_layout_engine("constrained", w_pad=0.02, h_pad=0.02, wspace=0, hspace=0)
        panels = np.ravel(figure.subplots(rows, columns, squeeze=False))
        for axes in panels:
            axes.set_axis_off()
        for axes, frame in zip(panels, frames, strict=False):
            axes.imshow(frame.image, interpolation="antialiased")
            axes.set_title(plain_text(frame.name), fontsize=6, pad=2)
            if frame.box is not None:
                x, y, w, h = frame.box
                line: dict[str, Any] = {"fill": False, "edgecolor": "red", "linewidth": 0.9}
                # box corners lie at pixel borders; one more pixel keeps a small target in view
                axes.add_patch(Rectangle((x - 1.5, y - 1.5), w + 2, h + 2, **line))
        return figure


def _sheet_columns(count: int) -> int:
    """Columns of a sheet: as many as fit, but fewer where that leaves fewer places empty."""
    if count <= _SHEET_COLUMNS - 2:
        return count
    return min(range(_SHEET_COLUMNS, 2, -1), key=lambda columns: -count % columns)


def _numbers(values: "pd.Series[Any]") -> npt.NDArray[np.float64]:
    return np.asarray(values, dtype=np.float64)


def _edges(values: npt.NDArray[np.float64], count: int = 30) -> npt.NDArray[np.float64]:
    kept = values[np.isfinite(values)]
    low, high = (kept.min(), kept.max()) if len(kept) else (0.0, 1.0)
    low = 0.0 if low > 0 and low < 0.5 * high else float(low)
    return np.linspace(low, float(high) if high > low else low + 1, count + 1)


def _histogram(
    axes: "Axes", values: npt.NDArray[np.float64], label: str, color: str, *, percent: bool = True
) -> None:
    kept = values[np.isfinite(values)]
    weights = np.full(len(kept), 100 / len(kept) if percent and len(kept) else 1.0)
    axes.hist(kept, bins=_edges(kept).tolist(), weights=weights, color=color)
    axes.set_xlabel(label)
    axes.grid(axis="y")
    _note_if_empty(axes, kept)


def _outline(
    axes: "Axes",
    values: npt.NDArray[np.float64],
    edges: npt.NDArray[np.float64],
    color: str,
    label: str,
) -> None:
    kept = values[np.isfinite(values)]
    weights = np.full(len(kept), 100 / max(len(kept), 1))
    style: dict[str, Any] = {"histtype": "step", "linewidth": 1.3, "color": color}
    axes.hist(kept, bins=edges.tolist(), weights=weights, label=label, **style)
    axes.grid(axis="y")


def _log_histogram(axes: "Axes", values: "pd.Series[Any]", label: str, color: str) -> None:
    """Histogram over a logarithmic axis; the share of zeros is told in words.

    The smallest 0.5 % join the first bar, so that a few of them do not stretch the axis.
    """
    numbers = _numbers(values)
    numbers = numbers[np.isfinite(numbers)]
    positive = numbers[numbers > 0]
    axes.set_xlabel(label)
    axes.grid(axis="y")
    _note_if_empty(axes, positive)
    if not len(positive):
        return
    low, high = np.percentile(positive, (0.5, 100))
    low = min(low / 1.2, high / 3)
    edges = np.geomspace(low, 1.05 * high, 31)
    weights = np.full(len(positive), 100 / len(numbers))
    axes.hist(np.maximum(positive, low), bins=edges.tolist(), weights=weights, color=color)
    axes.set_xscale("log")
    axes.margins(y=0.14)  # room for words above the bars
    _plain_ticks(axes, wide=high / low > 50)
    if still := len(numbers) - len(positive):
        text = f"{100 * still / len(numbers):.1f} % are 0"
        style: dict[str, Any] = {"color": GREY, "fontsize": 7, "va": "top"}
        axes.text(0.02, 0.99, text, transform=axes.transAxes, **style)


def _plain_ticks(axes: "Axes", *, wide: bool) -> None:
    from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter

    axes.xaxis.set_major_locator(LogLocator(subs=(1.0,) if wide else (1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.yaxis.set_major_locator(MaxNLocator(5, integer=True))


def _note_if_empty(axes: "Axes", values: npt.NDArray[np.float64]) -> None:
    if not len(values):
        axes.text(0.5, 0.5, "none", transform=axes.transAxes, ha="center", color=GREY)


def _mark(axes: "Axes", value: float, label: str) -> None:
    """A vertical line with its label on the side where there is more room."""
    axes.axvline(value, color=VERMILION, linestyle="--", linewidth=1)
    if label:
        place = axes.transAxes.inverted().transform(axes.transData.transform((value, 0)))[0]
        right = place < 0.6
        style: dict[str, Any] = {
            "xycoords": ("data", "axes fraction"),
            "textcoords": "offset points",
            "ha": "left" if right else "right",
            "va": "top",
            "color": VERMILION,
            "fontsize": 7,
        }
        axes.annotate(label, (value, 1.0), (3 if right else -3, -1), **style)
