import math

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from nat2024.errors import ArrayContract
from nat2024_trackers.siamese import crops
from nat2024_trackers.siamese.crops import (
    context_side,
    crop,
    mean_color,
    search_window,
    template_side,
)
from nat2024_trackers.siamese.state import Constants, FirstFrame, Target

ALEX = Constants(
    instance_size=287,
    map_size=21,
    stride=8,
    penalty_k=0.16,
    window_influence=0.4,
    learning_rate=0.3,
    anchors=5,
)
FILL = np.array([7, 80, 200], dtype=np.uint8)


def noise(width: int, height: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 256, (height, width, 3), dtype=np.uint8)


def pad_then_crop(image, center_x, center_y, side, size, fill):
    """The plain form: pad the whole frame by what is missing on each side, cut, resize."""
    height, width = image.shape[:2]
    half = (side + 1) / 2
    x0, y0 = math.floor(center_x - half + 0.5), math.floor(center_y - half + 0.5)
    x1, y1 = x0 + side - 1, y0 + side - 1
    left, top = max(0, -x0), max(0, -y0)
    right, bottom = max(0, x1 - width + 1), max(0, y1 - height + 1)
    padded = np.zeros((height + top + bottom, width + left + right, 3), dtype=np.uint8)
    padded[:] = fill
    padded[top : top + height, left : left + width] = image
    patch = padded[y0 + top : y1 + top + 1, x0 + left : x1 + left + 1]
    assert patch.shape == (side, side, 3)
    return patch if side == size else cv2.resize(patch, (size, size))


@settings(max_examples=300, deadline=None)
@given(
    width=st.integers(1, 40),
    height=st.integers(1, 40),
    center_x=st.floats(-60, 100),
    center_y=st.floats(-60, 100),
    side=st.integers(1, 90),
    size=st.sampled_from([5, 16, 31]),
)
def test_a_crop_equals_pad_then_crop(width, height, center_x, center_y, side, size):
    image = noise(width, height)
    target = Target(center_x, center_y, 10, 10)
    expected = pad_then_crop(image, center_x, center_y, side, size, FILL)
    np.testing.assert_array_equal(crop(image, target, side, size, FILL), expected)


@pytest.mark.parametrize("center_x", [0.0, 0.5, 1.5, 2.5, 19.5, 20.0])
@pytest.mark.parametrize("side", [4, 5, 16])
def test_halves_round_as_in_pad_then_crop(center_x, side):
    image = noise(20, 20)
    expected = pad_then_crop(image, center_x, 10.5, side, 16, FILL)
    np.testing.assert_array_equal(
        crop(image, Target(center_x, 10.5, 1, 1), side, 16, FILL), expected
    )


def test_a_crop_that_misses_the_image_is_filled():
    patch = crop(noise(20, 20), Target(500, -500, 10, 10), 30, 16, FILL)
    assert patch.shape == (16, 16, 3)
    assert (patch == FILL).all()


@pytest.mark.parametrize("center", [10.0, 0.0])
def test_a_crop_is_a_copy(center):
    image = noise(20, 20)
    kept = image.copy()
    patch = crop(image, Target(center, center, 1, 1), 8, 8, FILL)
    patch[:] = 0
    np.testing.assert_array_equal(image, kept)


@settings(max_examples=60, deadline=None)
@given(center_x=st.floats(-30, 60), center_y=st.floats(-30, 60), side=st.integers(1, 120))
def test_a_sampled_crop_is_within_one_level_of_the_canvas_form(center_x, center_y, side):
    image = noise(40, 30)
    target = Target(center_x, center_y, 1, 1)
    size = 16
    if side in (size, 2 * size):  # cv2 copies at 1 and averages at 2
        side += 1
    whole = crop(image, target, side, size, FILL).astype(int)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(crops, "LARGEST_CANVAS", 0)
        sampled = crop(image, target, side, size, FILL).astype(int)
    assert np.abs(sampled - whole).max() <= 1


def test_a_crop_of_any_side_needs_no_canvas_of_that_side():
    patch = crop(noise(40, 30), Target(20, 15, 1, 1), 2**29, 16, FILL)
    assert (patch == FILL).all()


def test_the_mean_color_is_truncated():
    image = np.zeros((1, 2, 3), dtype=np.uint8)
    image[0] = [[1, 255, 10], [0, 254, 10]]
    np.testing.assert_array_equal(mean_color(image), [0, 254, 10])


@pytest.mark.parametrize(("width", "side"), [(1.25, 2), (1.75, 4), (2.0, 4), (0.01, 1)])
def test_template_sides_round_half_to_even_and_are_at_least_one(width, side):
    # A square of side w has a context side of 2 w.
    assert context_side(Target(0, 0, width, width), ALEX) == 2 * width
    assert template_side(Target(0, 0, width, width), ALEX) == side


def test_sides_of_the_published_start_box():
    target = Target(368, 234, 32, 122)
    assert template_side(target, ALEX) == 147
    first = FirstFrame(FILL, 147, ())
    window = search_window(target, first, (640, 360), ALEX)
    assert window.side == 333
    assert window.scale == pytest.approx(127 / math.sqrt(109 * 199))


@pytest.mark.parametrize("size", [1e12, 1e200])
def test_boxes_beyond_any_image_are_refused(size):
    with pytest.raises(ArrayContract, match="too large to crop"):
        template_side(Target(0, 0, size, size), ALEX)


def test_the_rule_for_large_targets_takes_the_scale_of_the_first_frame():
    import dataclasses

    constants = dataclasses.replace(ALEX, large_target_share=0.5)
    first = FirstFrame(FILL, 50, ())
    large, small = Target(50, 50, 80, 70), Target(50, 50, 70, 70)
    assert search_window(large, first, (100, 100), constants).scale == 127 / 50
    assert search_window(large, first, (100, 100), constants).side == round(50 * 287 / 127)
    for target, rule in ((small, constants), (large, ALEX)):
        expected = 127 / context_side(target, rule)
        assert search_window(target, first, (100, 100), rule).scale == expected
