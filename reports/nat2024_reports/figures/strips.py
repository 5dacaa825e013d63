"""Strips of frames with boxes: what several runs did at the moments that tell most."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from nat2024.types import Box, Floats, Image
from nat2024_reports.figures.looks import Look
from nat2024_reports.framing import choose_view, cut_view, place_box
from nat2024_reports.overlays import WHITE, bgr, edge_of
from nat2024_reports.style import GREY, PAGE, figure_style, new_figure, plain_text, shortened

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

ASPECT = 4 / 3
"""Width over height of a picture in a strip."""

_PIXELS = 400  # width of a picture, for a print of 300 dots an inch
_GAP = 0.03  # inches between pictures
_LEAST_SIZE = 4.0  # points, of the name of a run over a picture
_INSET = 0.42  # width of an inset over that of its picture


@dataclass(frozen=True, slots=True)
class StripFrame:
    """One column of a strip.

    Attributes:
        frame: 0-based number.
        reason: why it is shown; may be empty.
        images: uint8 (H, W, 3) BGR, one a row of the strip; None where it could not be read.
        truth: x, y, w, h in pixels of the frame, None where not known.
        boxes: by run.
        about: which run the reason is about; may be empty.
    """

    frame: int
    reason: str
    images: tuple[Image | None, ...]
    truth: Box | None = None
    boxes: Mapping[str, Box] = field(default_factory=dict)
    about: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class Timeline:
    """Overlap over the frames of a sequence, drawn below a strip.

    Attributes:
        frames: int (n,), 0-based numbers, by run.
        overlap: float64 (n,), NaN where the truth is not known, by run.
    """

    frames: Mapping[str, Any]
    overlap: Mapping[str, Floats]


def strip_figure(
    columns: Sequence[StripFrame],
    looks: Mapping[str, Look],
    *,
    rows: Sequence[str] = ("",),
    title: str = "",
    whole: bool = False,
    timeline: Timeline | None = None,
) -> "Figure":
    """Pictures side by side, boxes solid with an enhancer and dashed without, as Figure 6.

    Args:
        columns: from left to right.
        looks: by run; those that are in no column are not in the legend either.
        rows: what each row of pictures is, such as `original` and `LDEnhancer`.
        title: above, may be empty.
        whole: show whole frames with an inset around the target, else the region around it.
        timeline: drawn below, with the moments marked.
    """
    shown = {run: look for run, look in looks.items() if any(run in c.boxes for c in columns)}
    shape = ASPECT
    if whole:
        images = [image for column in columns for image in column.images if image is not None]
        shape = images[0].shape[1] / images[0].shape[0] if images else ASPECT
    layout = _Layout(len(columns), len(rows), shape, bool(title), timeline is not None, len(shown))
    with figure_style():
        figure = new_figure(PAGE, layout.height)
        figure.set_layout_engine("none")
        for number, column in enumerate(columns):
            for row in range(len(rows)):
                axes = figure.add_axes(layout.picture(row, number))
                _draw_picture(axes, column, column.images[row], shown, shape, whole=whole)
                if row == 0:
                    _head(axes, column)
                if number == 0 and rows[row]:
                    axes.set_ylabel(plain_text(rows[row]), fontsize=7, labelpad=3)
        if title:
            figure.text(
                layout.left, layout.title, plain_text(title), weight="bold", va="top", fontsize=8
            )
        _legend(figure, shown, layout, has_truth=any(c.truth is not None for c in columns))
        if timeline is not None:
            axes = figure.add_axes(layout.timeline)
            _draw_timeline(axes, timeline, columns, shown)
        return figure


def _head(axes: "Axes", column: StripFrame) -> None:
    """Why a column is shown, and below which run it is about, no wider than the picture."""
    room = axes.get_position().width * PAGE * 72  # points
    about = shortened(column.about, max(5, int(room / (0.6 * _LEAST_SIZE))))
    lines = ((column.reason, 0.13 if column.about else 0.03, 6.5), (about, 0.03, 5.0))
    for text, height, size in lines:
        shown = axes.text(
            0.5,
            1 + height,
            text,
            transform=axes.transAxes,
            ha="center",
            va="bottom",
            fontsize=size,
        )
        wide = shown.get_window_extent(dpi=72).width  # points
        shown.set_fontsize(max(_LEAST_SIZE, size * min(1.0, 0.98 * room / max(wide, 1.0))))


class _Layout:
    """Places of the parts of a strip, in parts of the figure."""

    def __init__(
        self, columns: int, rows: int, shape: float, title: bool, timeline: bool, runs: int
    ) -> None:
        self._left = 0.2
        self._width = (PAGE - self._left - 0.02 - (columns - 1) * _GAP) / max(columns, 3)
        self._tall = self._width / shape
        self.legend_columns = max(1, min(-(-(runs + 1) // 2), 4))
        legend = 0.16 * -(-(runs + 1) // self.legend_columns) + 0.08
        above = (0.2 if title else 0.03) + 0.25
        line = 1.05 if timeline else 0.0
        self.height = above + rows * self._tall + (rows - 1) * _GAP + legend + line
        self._first = self.height - above
        self.left = self._left / PAGE
        self.title = 1 - 0.03 / self.height
        bottom = self._first - rows * self._tall - (rows - 1) * _GAP
        self.legend = (bottom - 0.05) / self.height
        self.timeline = (
            0.42 / PAGE,
            0.3 / self.height,
            (PAGE - 0.6) / PAGE,
            max(0.05, line - 0.38) / self.height,
        )

    def picture(self, row: int, column: int) -> tuple[float, float, float, float]:
        left = self._left + column * (self._width + _GAP)
        bottom = self._first - (row + 1) * self._tall - row * _GAP
        return (
            left / PAGE,
            bottom / self.height,
            self._width / PAGE,
            self._tall / self.height,
        )


def _draw_picture(
    axes: "Axes",
    column: StripFrame,
    image: Image | None,
    looks: Mapping[str, Look],
    shape: float,
    *,
    whole: bool,
) -> None:
    size = (_PIXELS, round(_PIXELS / shape))
    axes.set(xticks=[], yticks=[], xlim=(0, size[0]), ylim=(size[1], 0))
    for spine in axes.spines.values():
        spine.set_visible(False)
    if image is None:
        axes.set_facecolor("#eeeeee")
        axes.text(0.5, 0.5, "no image", transform=axes.transAxes, ha="center", va="center")
        return
    frame_size = (image.shape[1], image.shape[0])
    near = choose_view(frame_size, column.truth, column.boxes.values(), aspect=shape)
    view = np.array([0.0, 0.0, *frame_size]) if whole else near
    _draw_view(axes, column, image, view, size, looks)
    if whole and column.truth is not None:
        _draw_inset(axes, column, image, size, looks)
    axes.text(
        0.02,
        0.97,
        f"#{column.frame:04d}",
        transform=axes.transAxes,
        va="top",
        fontsize=6,
        color="white",
        path_effects=_halo(1.4),
    )


def _draw_view(
    axes: "Axes",
    column: StripFrame,
    image: Image,
    view: Box,
    size: tuple[int, int],
    looks: Mapping[str, Look],
    width: float = 0.9,
) -> None:
    axes.imshow(
        cut_view(image, view, size)[..., ::-1],
        extent=(0, size[0], size[1], 0),
        interpolation="antialiased",
        aspect="auto",
    )
    if column.truth is not None:
        _draw_box(axes, place_box(column.truth, view, size), "white", "-", width)
    for run, look in looks.items():
        if run in column.boxes:
            box = place_box(column.boxes[run], view, size)
            line = (0, (2.6, 1.3)) if look.is_dashed else "-"
            _draw_box(axes, box, look.color, line, width)
    axes.set(xlim=(0, size[0]), ylim=(size[1], 0))


def _draw_box(axes: "Axes", box: Box, color: str, line: Any, width: float) -> None:
    from matplotlib.colors import to_hex
    from matplotlib.patches import Rectangle

    if not np.isfinite(box).all():
        return
    corner = (float(box[0]), float(box[1]))
    edge = "white" if edge_of(bgr(to_hex(color))) == WHITE else "black"
    for shade, thickness, alpha in ((edge, width + 0.7, 0.5), (color, width, 1.0)):
        axes.add_patch(
            Rectangle(
                corner,
                float(box[2]),
                float(box[3]),
                fill=False,
                edgecolor=shade,
                linewidth=thickness,
                linestyle=line,
                alpha=alpha,
                joinstyle="miter",
            )
        )


def _draw_inset(
    axes: "Axes",
    column: StripFrame,
    image: Image,
    size: tuple[int, int],
    looks: Mapping[str, Look],
) -> None:
    """The region around the target, in the corner that is farthest from it."""
    assert column.truth is not None
    frame_size = (image.shape[1], image.shape[0])
    view = choose_view(frame_size, column.truth, aspect=1.0, sides=3.0)
    if view[2] > 0.3 * frame_size[0]:
        return  # the target is large enough as it is
    side = _INSET * size[0] / max(size)
    height = side * size[0] / size[1]
    centre = column.truth[:2] + column.truth[2:] / 2
    is_left = centre[0] > frame_size[0] / 2
    is_low = centre[1] < frame_size[1] / 2
    inset = axes.inset_axes(
        (0.01 if is_left else 0.99 - side, 0.01 if is_low else 0.99 - height, side, height)
    )
    pixels = round(_PIXELS * side)
    _draw_view(inset, column, image, view, (pixels, pixels), looks, width=0.8)
    inset.set(xticks=[], yticks=[])
    for spine in inset.spines.values():
        spine.set(visible=True, edgecolor="white", linewidth=0.8)


def _legend(
    figure: "Figure", looks: Mapping[str, Look], layout: _Layout, *, has_truth: bool
) -> None:
    from matplotlib.lines import Line2D

    entries = []
    for look in looks.values():
        line: Any = look.line
        entries.append(
            Line2D([], [], color=look.color, linestyle=line, linewidth=1.3, label=look.label)
        )
    if has_truth:
        truth = Line2D([], [], color="white", linewidth=1.3, label="Ground truth")
        truth.set_path_effects(_halo(2.4))
        entries.append(truth)
    figure.legend(
        handles=entries,
        loc="upper left",
        bbox_to_anchor=(layout.left, layout.legend),
        ncols=layout.legend_columns,
        borderaxespad=0,
        borderpad=0,
        handlelength=2.2,
        columnspacing=1.2,
        labelspacing=0.3,
        fontsize=6.5,
    )


def _draw_timeline(
    axes: "Axes",
    timeline: Timeline,
    columns: Sequence[StripFrame],
    looks: Mapping[str, Look],
) -> None:
    for column in columns:
        axes.axvline(column.frame, color=GREY, linewidth=0.6, linestyle=":", zorder=0)
        axes.text(
            column.frame,
            1.04,
            f"#{column.frame:04d}",
            fontsize=5,
            color=GREY,
            ha="center",
            transform=axes.get_xaxis_transform(),
        )
    for run, look in looks.items():
        if run in timeline.overlap:
            axes.plot(
                timeline.frames[run],
                timeline.overlap[run],
                color=look.color,
                linestyle=look.line,
                linewidth=0.9,
            )
    axes.set(ylim=(-0.02, 1.02), yticks=[0, 0.5, 1], ylabel="Overlap", xlabel="Frame")
    axes.margins(x=0.005)
    axes.tick_params(labelsize=6)
    axes.xaxis.label.set_fontsize(6.5)
    axes.yaxis.label.set_fontsize(6.5)


def _halo(width: float) -> list[Any]:
    from matplotlib import patheffects

    return [patheffects.withStroke(linewidth=width, foreground="black")]
