import math

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from nat2024_trackers.siamese.crops import template_side
from nat2024_trackers.siamese.state import Constants, Target
from nat2024_trackers.siamrpnpp.training.geometry import (
    EXEMPLAR,
    after,
    context_of,
    linear_map,
    outline_of,
    placed,
    standard_size,
    tight_box,
    warp,
)
from nat2024_trackers.siamrpnpp.training.movement import Ranges, draw_move
from nat2024_trackers.siamrpnpp.training.scenes import (
    centred,
    search_placement,
    template_placement,
)
from nat2024_trackers.siamrpnpp.training.shapes import SIDE, draw_mask

seeds = st.integers(0, 2**32)


def bounds_of_drawing(mask, transform, size=400, zoom=2):
    """Bounds x, y, w, h of a mask as it is drawn, measured on a finer grid."""
    finer = after(placed(np.eye(2) * zoom, np.zeros(2), np.zeros(2)), transform)
    drawn = warp(mask, finer, size * zoom, border=cv2.BORDER_CONSTANT)
    return np.array(cv2.boundingRect((drawn > 127).astype(np.uint8))) / zoom


@settings(max_examples=40, deadline=None)
@given(seeds)
def test_the_box_is_that_of_the_drawn_mask(seed):
    rng = np.random.default_rng(seed)
    mask = draw_mask(rng)
    linear = linear_map(
        width=rng.uniform(0.5, 1.6),
        height=rng.uniform(0.5, 1.6),
        angle=rng.uniform(-3, 3),
        shear=rng.normal(0, 0.1),
    )
    transform = placed(linear, np.full(2, SIDE / 2), np.full(2, 200.0))
    box = tight_box(outline_of(mask), transform)
    drawn = bounds_of_drawing(mask, transform)
    # the edge of a drawn pixel is bilinear: half a source pixel on each side
    np.testing.assert_allclose(box, drawn, atol=1.7)


@settings(max_examples=40, deadline=None)
@given(seeds, st.floats(-1.2, 1.2))
def test_a_template_is_cropped_as_the_tracker_crops_it(seed, shape):
    rng = np.random.default_rng(seed)
    mask = draw_mask(rng)
    place = template_placement(rng, mask, math.exp(shape))
    x, y, width, height = tight_box(outline_of(mask), place)
    constants = Constants(255, 17, 8, 0.0, 0.0, 0.0)
    # 127 pixels but for the few per cent of an annotator's error
    side = template_side(Target(0.0, 0.0, width, height), constants)
    assert side == pytest.approx(EXEMPLAR, rel=0.16)
    assert abs(x + width / 2 - EXEMPLAR / 2) < 9
    assert abs(y + height / 2 - EXEMPLAR / 2) < 9


@settings(max_examples=40, deadline=None)
@given(seeds)
def test_a_search_crop_has_the_target_where_the_move_says(seed):
    rng = np.random.default_rng(seed)
    mask = draw_mask(rng)
    ranges = Ranges()
    move = draw_move(rng, ranges)
    first = template_placement(rng, mask, 1.0)
    place = search_placement(first, mask, move, ranges.search)
    box = centred(tight_box(outline_of(mask), place), ranges.search)
    np.testing.assert_allclose(box[:2], move.shift, atol=1e-9)
    assert np.abs(box[:2]).max() <= ranges.shift
    before = tight_box(outline_of(mask), first)
    area = box[2] * box[3] / (before[2] * before[3])
    assert math.exp(-ranges.scale) / 1.6 < math.sqrt(area) < math.exp(ranges.scale) * 1.6


@given(st.floats(0.2, 5))
def test_a_target_of_standard_size_fills_a_template_with_its_context(aspect):
    width, height = standard_size(aspect)
    assert width / height == pytest.approx(aspect)
    assert context_of(width, height) == pytest.approx(EXEMPLAR)


@settings(max_examples=30, deadline=None)
@given(seeds)
def test_masks_are_tight_to_their_canvas(seed):
    mask = draw_mask(np.random.default_rng(seed))
    assert mask.shape == (SIDE, SIDE)
    assert set(np.unique(mask)) <= {0, 255}
    # but for tips that are thinner than a pixel
    _, _, width, height = cv2.boundingRect((mask > 127).astype(np.uint8))
    assert min(width, height) >= 0.85 * SIDE


def test_maps_follow_each_other():
    first = placed(linear_map(angle=0.4, width=2.0), np.array([1.0, 2]), np.array([5.0, 5]))
    second = placed(linear_map(shear=0.2, height=0.5), np.array([0.0, 1]), np.array([3.0, 3]))
    point = np.array([4.0, -2.0])
    once = first[:, :2] @ point + first[:, 2]
    twice = second[:, :2] @ once + second[:, 2]
    both = after(second, first)
    np.testing.assert_allclose(both[:, :2] @ point + both[:, 2], twice)


def test_an_image_is_drawn_where_its_box_says():
    image = np.full((10, 20, 3), 200, dtype=np.uint8)
    place = placed(np.eye(2) * 3, np.zeros(2), np.array([12.0, 24.0]))
    drawn = warp(image, place, 100, border=cv2.BORDER_CONSTANT)[..., 0]
    assert cv2.boundingRect((drawn > 100).astype(np.uint8)) == (12, 24, 60, 30)
