from typing import Any

import numpy as np
import pytest

from nat2024_reports.figures.enhancement import (
    SheetRow,
    channel_labels,
    comparison_strip,
    contact_sheet,
    maps_figure,
)
from nat2024_reports.style import figure_bytes


def image(height: int = 18, width: int = 32, value: int = 40) -> np.ndarray:
    return np.full((height, width, 3), value, np.uint8)


def texts(figure: Any) -> list[str]:
    return [text.get_text() for text in figure.texts]


def shown(figure: Any) -> list[np.ndarray]:
    return [np.asarray(drawn.get_array()) for axes in figure.axes for drawn in axes.images]


def test_a_sheet_has_a_row_an_image_and_a_column_an_enhancer() -> None:
    rows = [
        SheetRow("a_$1$.png", [image(), image(value=80)]),
        SheetRow("b.png", [image(30, 10), None]),
    ]
    figure = contact_sheet(["input", "gamma"], rows)
    assert texts(figure) == ["input", "gamma", r"a_\$1\$.png", "b.png"]
    assert [pixels.mean() for pixels in shown(figure)] == [40, 80, 40]
    (failed,) = [text for axes in figure.axes for text in axes.texts]
    assert failed.get_text() == "failed"


def test_cells_do_not_overlap_and_lie_on_the_page() -> None:
    rows = [SheetRow("a", [image(3, 500)] * 11), SheetRow("b", [image(500, 3)] * 11)]
    figure = contact_sheet([str(n) for n in range(11)], rows)
    boxes = [axes.get_position() for axes in figure.axes]
    assert len(boxes) == 22
    assert all(0 <= b.x0 < b.x1 <= 1 and 0 <= b.y0 < b.y1 <= 1 for b in boxes)
    for one in range(22):
        for other in range(one):
            a, b = boxes[one], boxes[other]
            apart = a.x0 >= b.x1 or b.x0 >= a.x1 or a.y0 >= b.y1 or b.y0 >= a.y1
            assert apart


def test_a_strip_enlarges_the_same_parts_of_each_image() -> None:
    before, after = image(), image(value=90)
    after[2:6, 3:8] = 200
    figure = comparison_strip(["input", "x"], [before, after], [(3, 2, 5, 4), (20, 9, 6, 6)])
    assert texts(figure) == ["input", "x"]
    pixels = shown(figure)
    assert [p.shape[:2] for p in pixels] == [(18, 32), (4, 5), (6, 6)] * 2
    assert (pixels[4] == 200).all()
    frames = [patch for axes in figure.axes for patch in axes.patches]
    assert [frame.get_xy() for frame in frames[:2]] == [(2.5, 1.5), (19.5, 8.5)]  # type: ignore[attr-defined]
    edges = [axes.spines["left"].get_edgecolor() for axes in figure.axes[1:3]]
    assert edges == [frame.get_edgecolor() for frame in frames[:2]]
    assert edges[0] != edges[1]


def test_a_strip_needs_no_insets() -> None:
    figure = comparison_strip(["input"], [image(1, 1)], [])
    assert len(figure.axes) == 1


def test_maps_with_negative_values_are_coloured_around_zero() -> None:
    values = np.linspace(-0.5, 0.25, 12 * 20 * 30, dtype=np.float32).reshape(12, 20, 30)
    figure = maps_figure("P_S", values)
    assert texts(figure)[0] == "P_S: -0.5 to 0.25, coloured around 0"
    labels = texts(figure)[1:]
    assert labels[:5] == [
        "red, iteration 1",
        "red, iteration 2",
        "red, iteration 3",
        "red, iteration 4",
        "green, iteration 1",
    ]
    drawn = [axes.images[0] for axes in figure.axes if axes.images]
    assert len(drawn) == 12
    assert {one.get_clim() for one in drawn} == {(-0.5, 0.5)}
    np.testing.assert_allclose(np.asarray(drawn[1].get_array()), values[3])


def test_light_is_normalised_and_drawn_as_a_picture_too() -> None:
    values = np.random.default_rng(0).random((3, 8, 9), dtype=np.float32) * 5
    figure = maps_figure("O2", values, "BGR")
    drawn = [axes.images[0] for axes in figure.axes if axes.images]
    picture = np.asarray(drawn[0].get_array())
    assert picture.shape == (8, 9, 3)
    np.testing.assert_allclose(picture[..., 0], values[2] / values.max(), rtol=1e-6)
    assert texts(figure)[2:] == ["blue", "green", "red"]
    limits = drawn[1].get_clim()
    assert limits == pytest.approx((0, values.max()))


def test_a_few_large_values_do_not_hide_all_others() -> None:
    values = np.full((3, 100, 100), 0.1, np.float32)
    values[0, 0, 0] = 40
    figure = maps_figure("O2", values)
    drawn = [axes.images[0] for axes in figure.axes if axes.images]
    assert drawn[1].get_clim() == pytest.approx((0, 0.1))
    assert "0.1 to 40" in texts(figure)[0]


@pytest.mark.parametrize("shape", [(1, 1, 1), (8, 3, 5), (24, 2, 400), (3, 900, 1200), (5, 40, 2)])
def test_any_map_can_be_drawn(shape: tuple[int, int, int]) -> None:
    values = np.zeros(shape, np.float32)
    values[0, 0, 0] = np.nan
    assert figure_bytes(maps_figure("m", values), ".png").startswith(b"\x89PNG")


def test_channels_have_names() -> None:
    assert channel_labels(3, "BGR") == ["blue", "green", "red"]
    assert channel_labels(6)[3] == "red, iteration 2"
    assert channel_labels(2) == ["channel 1", "channel 2"]


@pytest.mark.parametrize(
    ("ending", "start"), [(".png", b"\x89PNG"), (".JPG", b"\xff\xd8"), (".pdf", b"%PDF")]
)
def test_equal_figures_are_equal_files(ending: str, start: bytes) -> None:
    made = [figure_bytes(contact_sheet(["a"], [SheetRow("r", [image()])]), ending) for _ in "ab"]
    assert made[0] == made[1]
    assert made[0].startswith(start)
