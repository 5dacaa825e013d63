import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nat2024_trackers.hift.decoder import DistanceDecoder, distance_constants, distances

SIDES = st.floats(-0.98, 0.98)


def maps_of(classes=0.0, logit=0.0, values=0.0, count=1):
    shapes = ((2, classes), (1, logit), (4, values))
    return tuple(np.full((count, n, 11, 11), v, dtype=np.float32) for n, v in shapes)


def test_the_constants_that_both_trackers_share():
    constants = distance_constants(0.1, 0.2, 0.3)
    assert (constants.instance_size, constants.map_size, constants.stride) == (287, 11, 16)
    assert (constants.penalty_k, constants.window_influence) == (0.1, 0.2)
    assert constants.learning_rate == 0.3
    assert constants.ratio_epsilon == 1e-5
    assert constants.large_target_share == 0.5
    assert constants.anchors == 1


def test_cells_reach_from_minus_80_to_80():
    decoder = DistanceDecoder()
    x, y = decoder.x.reshape(11, 11), decoder.y.reshape(11, 11)
    assert x[3].tolist() == y[:, 3].tolist() == list(range(-80, 81, 16))
    assert set(x[:, 2]) == {-48.0}


@pytest.mark.parametrize(
    ("value", "counted"),
    [
        (0.0, 0.0),
        (0.5, 0.5),
        (-0.5, -0.5),
        (1.0, 0.99),
        (7.0, 0.99),
        (np.inf, 0.99),
        (-1.0, -0.99),
        (-7.0, -0.99),
        (0.999, 0.999),
        (-0.999, -0.999),
    ],
)
def test_only_values_from_one_are_limited(value, counted):
    found = distances(np.array([value], dtype=np.float32))
    assert found[0] == pytest.approx(143 * math.atanh(counted), rel=1e-4)


def test_distances_just_within_one_are_the_largest():
    within, limited = distances(np.array([0.9999, 1.0], dtype=np.float32))
    assert np.isfinite(within)
    assert within > limited


def test_limits_leave_the_maps_as_they_are():
    values = np.array([-3.0, 3.0], dtype=np.float32)
    distances(values)
    assert values.tolist() == [-3, 3]


@given(
    left=SIDES,
    right=SIDES,
    top=SIDES,
    bottom=SIDES,
    row=st.integers(0, 10),
    column=st.integers(0, 10),
)
def test_a_box_has_its_sides_at_the_distances_from_its_cell(left, right, top, bottom, row, column):
    classes, logit, values = maps_of()
    values[0, :, row, column] = left, right, top, bottom
    boxes = DistanceDecoder()((classes, logit, values)).boxes
    x, y, width, height = boxes[0, :, row * 11 + column]
    sides = (x - width / 2, x + width / 2, y - height / 2, y + height / 2)
    cell_x, cell_y = column * 16 - 80, row * 16 - 80
    reach = [143 * math.atanh(v) for v in (left, right, top, bottom)]
    expected = (cell_x - reach[0], cell_x + reach[1], cell_y - reach[2], cell_y + reach[3])
    np.testing.assert_allclose(sides, expected, atol=1e-3)


def test_the_score_is_the_mean_of_a_softmax_and_a_raw_logit():
    classes, logit, values = maps_of(count=2)
    classes[1, 1, 4, 7] = 2
    logit[1, 0, 4, 7] = 3.5
    scores = DistanceDecoder()((classes, logit, values)).scores
    assert scores.dtype == np.float32
    assert scores.shape == (2, 121)
    assert scores[1].argmax() == 4 * 11 + 7
    assert scores[1].max() == pytest.approx((1 / (1 + math.exp(-2)) + 3.5) / 2)
    np.testing.assert_allclose(scores[0], 0.25)


def test_boxes_are_float64():
    assert DistanceDecoder()(maps_of()).boxes.dtype == np.float64


def test_numbers_that_are_none_stay_none_without_a_warning():
    classes, logit, values = maps_of(classes=np.inf, values=np.nan)
    values[0, :, 5, 5] = 0.1
    found = DistanceDecoder()((classes, logit, values))
    assert np.isnan(found.scores).all()
    assert np.isfinite(found.boxes[0, :, 60]).all()
    assert np.isnan(np.delete(found.boxes[0], 60, axis=1)).all()
