from dataclasses import replace
from itertools import pairwise

import numpy as np

from nat2024_reports.figures.looks import Look
from nat2024_reports.figures.strips import StripFrame, Timeline, strip_figure
from nat2024_reports.style import figure_bytes

LOOKS = {
    "t": Look("T", "#0072B2", True, "", "o"),
    "t+e": Look("T + E", "#D55E00", False, "", "s"),
    "unused": Look("Unused", "#009E73", False, "", "^"),
}


def column(frame: int, **changes: object) -> StripFrame:
    image = np.full((90, 160, 3), 60, np.uint8)
    box = np.array([70.0, 40, 14, 10])
    given = {"truth": box, "boxes": {"t": box + 2, "t+e": box}, **changes}
    return StripFrame(frame, "largest gain", (image, None), about="T + E", **given)  # type: ignore[arg-type]


def texts(figure: object) -> list[str]:
    return [text.get_text() for text in figure.findobj(lambda o: hasattr(o, "get_text"))]  # type: ignore[attr-defined]


def test_rows_columns_reasons_and_legend() -> None:
    timeline = Timeline({"t": np.arange(30)}, {"t": np.linspace(1, 0, 30)})
    columns = [column(3), column(17), column(29, truth=None, boxes={})]
    figure = strip_figure(columns, LOOKS, rows=["original", "E"], title="a$b", timeline=timeline)
    assert len(figure.axes) == 7
    found = texts(figure)
    assert "#0017" in found
    assert found.count("largest gain") == 3
    assert {"T", "T + E", "Ground truth", "original", "no image"} <= set(found)
    assert "Unused" not in found  # no box of it is shown
    assert figure_bytes(figure, ".png") == figure_bytes(
        strip_figure(columns, LOOKS, rows=["original", "E"], title="a$b", timeline=timeline), ".png"
    )


def test_dashed_without_and_solid_with_an_enhancer() -> None:
    from matplotlib.colors import to_hex
    from matplotlib.patches import Rectangle

    figure = strip_figure([column(0)], LOOKS, rows=["original", "E"])
    lines = {
        patch.get_edgecolor(): patch.get_linestyle()
        for patch in figure.axes[0].patches
        if isinstance(patch, Rectangle)
    }
    by_hex = {to_hex(color): line for color, line in lines.items()}
    assert by_hex["#0072b2"] not in ("-", "solid")
    assert by_hex["#d55e00"] in ("-", "solid")
    assert by_hex["#ffffff"] in ("-", "solid")


def test_whole_frames_have_an_inset_around_a_small_target() -> None:
    small = np.array([70.0, 40, 4, 4])
    figure = strip_figure([column(0, truth=small)], LOOKS, rows=["", ""], whole=True)
    assert len(figure.axes[0].child_axes) == 1
    large = np.array([20.0, 10, 90, 60])
    figure = strip_figure([column(0, truth=large)], LOOKS, rows=["", ""], whole=True)
    assert not figure.axes[0].child_axes


def test_boxes_that_are_no_numbers_or_far_away_are_drawn_without_harm() -> None:
    odd = {"t": np.full(4, np.nan), "t+e": np.array([1e9, 1e9, 3, 3])}
    figure = strip_figure([column(0, boxes=odd)], LOOKS, rows=["", ""])
    assert figure_bytes(figure, ".pdf").startswith(b"%PDF")


def test_names_over_pictures_stay_apart() -> None:
    columns = [
        replace(column(frame), about="SiamRPN++ (compact) + LDEnhancer") for frame in range(6)
    ]
    figure = strip_figure(columns, LOOKS, rows=["original", "E"])
    figure.draw_without_rendering()
    names = [t for axes in figure.axes for t in axes.texts if t.get_text().startswith("SiamRPN")]
    extents = sorted((t.get_window_extent().x0, t.get_window_extent().x1) for t in names)
    assert len(extents) == 6
    assert all(left[1] <= right[0] for left, right in pairwise(extents))
