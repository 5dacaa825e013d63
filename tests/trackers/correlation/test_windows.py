import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nat2024_trackers.correlation.windows import (
    Target,
    hann_window,
    target_window,
    window_around,
)

sides = st.floats(0.01, 1e7)


@given(sides, sides, st.sampled_from(["even", "proportional"]))
def test_windows_of_any_target_are_small_and_even(width, height, shape):
    window = window_around(
        (width, height), padding=2.0, shape=shape, cell=4, area=(150.0**2, 200.0**2)
    )
    assert window.columns % 2 == 0
    assert window.rows % 2 == 0
    assert min(window.columns, window.rows) >= 4
    assert window.columns * window.rows * 16 < 60 * 200**2
    assert np.isfinite(window.extent(1.0)).all()
    assert target_window(window, 1.5).max() > 0.2


@given(st.floats(10, 60), st.floats(10, 60))
def test_an_even_window_leaves_the_same_room_on_all_sides(width, height):
    window = window_around(
        (width, height), padding=2.0, shape="even", cell=4, area=(200.0**2, 200.0**2)
    )
    across, down = window.extent(1.0)
    room = 2 * np.sqrt(width * height)
    cells = 4 * 4 / window.density  # what rounding to fast sizes may add
    assert across - width == pytest.approx(room, abs=cells + 0.1 * across)
    assert down - height == pytest.approx(room, abs=cells + 0.1 * down)


def test_within_the_areas_a_sample_is_a_pixel():
    words = {"padding": 1.0, "shape": "proportional", "cell": 1, "area": (64.0**2, 128.0**2)}
    assert window_around((40, 40), **words).density == 1
    assert window_around((10, 10), **words).density == pytest.approx(3.2)
    assert window_around((256, 256), **words).density == 0.25
    assert window_around((256, 256), **words).extent(2.0) == (1024, 1024)


def test_the_centre_stays_on_the_frame_and_the_box_follows():
    target = Target.from_annotation(np.array([10.0, 20.0, 30.0, 40.0]))
    assert target.center == (25, 40)
    np.testing.assert_array_equal(target.box, [10, 20, 30, 40])
    moved = target.moved((-100.0, 3.0), 2.0, (200, 100))
    assert moved.center == (0, 43)
    np.testing.assert_array_equal(moved.box, [-30, 3, 60, 80])


def test_weights_are_largest_in_the_middle_and_symmetric():
    weights = hann_window(8, 12)
    np.testing.assert_allclose(weights, weights[::-1, ::-1], atol=1e-6)
    assert weights.min() > 0
    window = window_around((40, 20), padding=2.0, shape="even", cell=4, area=(200.0**2,) * 2)
    inside = target_window(window, 1.5)
    np.testing.assert_allclose(inside, inside[::-1, ::-1], atol=1e-6)
    across, down = (1.5 * side / 2 for side in window.target)
    assert np.count_nonzero(inside.any(axis=0)) == pytest.approx(2 * across, abs=2)
    assert np.count_nonzero(inside.any(axis=1)) == pytest.approx(2 * down, abs=2)
