import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nat2024_reports.framing import choose_view, cut_view, place_box

SIDES = st.integers(40, 2000)
NUMBERS = st.floats(-3000, 3000)


@given(SIDES, SIDES, st.tuples(NUMBERS, NUMBERS, st.floats(1, 900), st.floats(1, 900)))
def test_a_view_lies_in_the_frame_and_has_its_aspect(
    width: int, height: int, box: tuple[float, ...]
) -> None:
    x, y, w, h = choose_view((width, height), np.array(box))
    assert x >= 0
    assert y >= 0
    assert x + w <= width + 1e-6
    assert y + h <= height + 1e-6
    assert w / h == pytest.approx(4 / 3)


def test_near_boxes_are_taken_in_and_far_ones_are_not() -> None:
    target = np.array([500.0, 300.0, 20.0, 20.0])
    alone = choose_view((1920, 1080), target)
    assert alone[2] == pytest.approx(100)
    near = choose_view((1920, 1080), target, [np.array([555.0, 300.0, 20.0, 20.0])])
    assert near[0] < 500
    assert near[0] + near[2] > 575
    assert near[2] < 200
    far = choose_view((1920, 1080), target, [np.array([1500.0, 300.0, 20.0, 20.0])])
    np.testing.assert_array_equal(far, alone)
    bad = choose_view((1920, 1080), target, [np.full(4, np.nan)])
    np.testing.assert_array_equal(bad, alone)


def test_without_a_target_it_is_the_middle() -> None:
    for target in (None, np.full(4, np.nan), np.array([10.0, 10, 0, 5])):
        view = choose_view((400, 200), target)
        np.testing.assert_allclose(view, [66.67, 0, 266.67, 200], atol=0.01)


@pytest.mark.parametrize("size", [(40, 30), (160, 120), (400, 300)])
def test_boxes_lie_where_their_pixels_are(size: tuple[int, int]) -> None:
    image = np.zeros((240, 320, 3), np.uint8)
    image[100:140, 60:100] = 255
    view = np.array([33.5, 61.25, 160.0, 120.0])
    picture = cut_view(image, view, size)
    assert picture.shape == (size[1], size[0], 3)
    x, y, w, h = place_box(np.array([60.0, 100, 40, 40]), view, size)
    rows, columns = np.nonzero(picture[..., 0] > 127)
    assert columns.min() == pytest.approx(x, abs=1)
    assert columns.max() + 1 == pytest.approx(x + w, abs=1)
    assert rows.min() == pytest.approx(y, abs=1)
    assert rows.max() + 1 == pytest.approx(y + h, abs=1)
