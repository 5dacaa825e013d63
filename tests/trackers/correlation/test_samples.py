import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from nat2024_trackers.correlation.samples import cut, cut_all


@pytest.fixture
def image():
    return np.random.default_rng(1).integers(0, 256, (40, 60, 3), dtype=np.uint8)


def test_whole_pixels_are_copied(image):
    kept = image.copy()
    found = cut(image, (30.0, 20.0), (16, 12), (16, 12))
    assert found.dtype == np.uint8
    np.testing.assert_array_equal(found, image[14:26, 22:38])
    found[:] = 0
    np.testing.assert_array_equal(image, kept)


def test_beyond_the_border_the_edge_is_repeated(image):
    found = cut(image, (0.0, 0.0), (8, 8), (8, 8))
    np.testing.assert_array_equal(found[4:, 4:], image[:4, :4])
    np.testing.assert_array_equal(found[:4, :4], np.broadcast_to(image[0, 0], (4, 4, 3)))


@settings(max_examples=50, deadline=None)
@given(st.floats(-1e6, 1e6), st.floats(-1e6, 1e6), st.floats(1e-3, 1e6), st.floats(1e-3, 1e6))
def test_any_rectangle_gives_colours_of_the_image(x, y, width, height):
    image = np.random.default_rng(2).integers(50, 200, (20, 30, 3), dtype=np.uint8)
    found = cut(image, (x, y), (width, height), (12, 8))
    assert found.shape == (8, 12, 3)
    assert found.min() >= 50
    assert found.max() < 200


def test_fractions_of_pixels_are_interpolated():
    ramp = np.repeat(np.arange(0, 240, 4, dtype=np.float32)[None, :, None], 40, axis=0)
    ramp = np.repeat(ramp, 3, axis=2)
    found = cut(ramp, (30.25, 20.0), (10, 10), (10, 10))
    expected = 4 * (30.25 - 5 + np.arange(10))
    np.testing.assert_allclose(found[5, :, 0], expected, atol=4 / 32)


def test_enlarging_keeps_places():
    ramp = np.repeat(np.repeat(np.arange(60, dtype=np.float32)[None, :, None], 40, 0), 3, 2)
    found = cut(ramp, (30.0, 20.0), (10, 10), (40, 40))
    expected = 25 + (np.arange(40) + 0.5) / 4 - 0.5
    np.testing.assert_allclose(found[5, :, 0], expected, atol=1 / 32)


def test_strong_shrinking_averages_areas():
    board = ((np.indices((64, 64)).sum(axis=0) % 2) * 200).astype(np.uint8)
    image = np.repeat(board[..., None], 3, axis=2)
    found = cut(image, (32.0, 32.0), (64, 64), (16, 16))
    assert abs(found.astype(int) - 100).max() <= 1


def test_several_rectangles_are_cut_as_each_alone(image):
    extents = np.array([[10.0, 8.0], [12.0, 9.6], [15.0, 12.0]])
    together = cut_all(image, (31.3, 18.7), extents, (12, 8))
    for extent, found in zip(extents, together, strict=True):
        alone = cut(image, (31.3, 18.7), tuple(extent), (12, 8))
        # the places are rounded to 1/32 of a pixel from another origin
        assert abs(found.astype(int) - alone.astype(int)).max() <= 12
