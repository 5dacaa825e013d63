import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nat2024_trackers.siamapn.decoder import ProposalDecoder, proposal_constants
from nat2024_trackers.siamapn.plugin import ANCHOR_REACH, SCORE_WEIGHTS
from nat2024_trackers.siamapnpp import plugin as plus
from nat2024_trackers.siamese.crops import SearchWindow
from nat2024_trackers.siamese.selection import cosine_window, select
from nat2024_trackers.siamese.state import Target

SIDES = st.floats(-1, 2, width=32)
OFFSETS = st.floats(-0.5, 0.5, width=32)
CELL = st.integers(0, 20)


def maps_of(count=1, sides=0.0):
    cls1, cls2, cls3, loc, anchors = (
        np.zeros((count, channels, 21, 21), dtype=np.float32) for channels in (2, 2, 1, 4, 4)
    )
    return cls1, cls2, cls3, loc, anchors + np.float32(sides)


def decoder():
    return ProposalDecoder(ANCHOR_REACH, SCORE_WEIGHTS)


def test_the_published_numbers():
    assert (ANCHOR_REACH, SCORE_WEIGHTS) == (143, (1.18, 1.0, 1.0))
    assert (plus.ANCHOR_REACH, plus.SCORE_WEIGHTS) == (71, (1.2, 1.3, 1.1))
    constants = proposal_constants(0.1, 0.2, 0.3)
    assert (constants.instance_size, constants.map_size, constants.stride) == (287, 21, 8)
    assert (constants.ratio_epsilon, constants.anchors) == (1e-5, 1)


def test_cells_reach_from_minus_80_to_80():
    x, y = decoder().x.reshape(21, 21), decoder().y.reshape(21, 21)
    assert x[3].tolist() == y[:, 3].tolist() == list(range(-80, 81, 8))
    assert set(x[:, 2]) == {-64.0}


@given(sides=st.tuples(SIDES, SIDES, SIDES, SIDES), row=CELL, column=CELL)
def test_an_anchor_has_its_sides_at_the_distances_from_its_cell(sides, row, column):
    maps = maps_of()
    maps[4][0, :, row, column] = sides
    x, y, width, height = decoder()(maps).boxes[0, :, row * 21 + column]
    found = (x - width / 2, x + width / 2, y - height / 2, y + height / 2)
    left, right, top, bottom = (143 * side for side in sides)
    cell_x, cell_y = column * 8 - 80, row * 8 - 80
    expected = (cell_x - left, cell_x + right, cell_y - top, cell_y + bottom)
    np.testing.assert_allclose(found, expected, atol=1e-4)


@given(offsets=st.tuples(OFFSETS, OFFSETS, OFFSETS, OFFSETS), row=CELL, column=CELL)
def test_offsets_move_and_scale_the_anchor(offsets, row, column):
    maps = maps_of(sides=0.2)
    maps[3][0, :, row, column] = dx, dy, dw, dh = offsets
    size = 143 * 0.4
    expected = (
        dx * size + column * 8 - 80,
        dy * size + row * 8 - 80,
        math.exp(dw) * size,
        math.exp(dh) * size,
    )
    found = decoder()(maps).boxes[0, :, row * 21 + column]
    np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize("weights", [(1.18, 1.0, 1.0), (1.2, 1.3, 1.1)])
def test_the_score_is_a_third_of_a_weighted_sum_with_a_raw_logit(weights):
    cls1, cls2, cls3, *boxes = maps_of(count=2)
    cls1[1, 1, 4, 7], cls2[1, 0, 4, 7], cls3[1, 0, 4, 7] = 2, 1, 3.5
    scores = ProposalDecoder(143, weights)((cls1, cls2, cls3, *boxes)).scores
    assert scores.dtype == np.float32
    assert scores.shape == (2, 441)
    assert scores[1].argmax() == 4 * 21 + 7
    w1, w2, w3 = weights
    expected = (w1 / (1 + math.exp(-2)) + w2 / (1 + math.exp(1)) + w3 * 3.5) / 3
    assert scores[1].max() == pytest.approx(expected)
    assert scores[1].max() > 1
    np.testing.assert_allclose(scores[0], (w1 + w2) / 6, rtol=1e-6)


def test_boxes_are_float64():
    assert decoder()(maps_of()).boxes.dtype == np.float64


def test_negative_sizes_and_no_numbers_give_no_warning_and_are_never_chosen():
    """Width and height of different sign have no size; argmax would take the first of them."""
    maps = maps_of(sides=0.2)
    maps[4][0, :, 0, 0] = -0.9, -0.9, 0.5, 0.5
    maps[4][0, :, 0, 1] = np.nan
    maps[3][0, 2, 0, 2] = 1e4
    maps[2][0, 0, :, :] = 5
    maps[2][0, 0, 12, 9] = 6
    constants = proposal_constants(0.08, 0.4364, 0.302)
    [step] = select(
        decoder()(maps),
        [Target(100, 100, 40, 40)],
        [SearchWindow(287, 1.0)],
        cosine_window(constants),
        [(640, 360)],
        constants,
    )
    assert step.index == 12 * 21 + 9
