import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from nat2024.errors import ArrayContract, LengthMismatch
from nat2024.metrics import center_error, normalized_center_error, overlap
from nat2024.metrics.geometry import columns_of, overlap_of

FUNCTIONS = [overlap, center_error, normalized_center_error]

# quarters of pixels: sums and products are exact, so equality can be asked for
quarters = st.integers(-4000, 4000).map(lambda value: value / 4)
positive_quarters = st.integers(1, 4000).map(lambda value: value / 4)
box = st.tuples(quarters, quarters, positive_quarters, positive_quarters)
pairs = st.lists(st.tuples(box, box), min_size=1, max_size=20).map(
    lambda rows: (np.array([a for a, _ in rows]), np.array([b for _, b in rows]))
)
wild = arrays(np.float64, st.tuples(st.integers(0, 6), st.just(4)), elements=st.floats(-1e6, 1e6))


def test_overlap_of_known_boxes() -> None:
    truth = [[0, 0, 10, 10]] * 5
    predicted = [[0, 0, 10, 10], [5, 0, 10, 10], [10, 0, 10, 10], [2, 2, 4, 5], [-5, -5, 20, 20]]
    expected = [1, 50 / 150, 0, 20 / 100, 100 / 400]
    np.testing.assert_array_equal(overlap(predicted, truth), expected)


def test_center_error_is_euclidean_and_sees_sizes() -> None:
    errors = center_error([[3, 4, 10, 10], [0, 0, 16, 10]], [[0, 0, 10, 10], [0, 0, 10, 10]])
    np.testing.assert_array_equal(errors, [5, 3])


def test_normalized_center_error_divides_each_axis_by_the_true_size() -> None:
    # dx 3 of width 10 is 0.3, dy 8 of height 20 is 0.4
    np.testing.assert_allclose(normalized_center_error([[3, 8, 10, 20]], [[0, 0, 10, 20]]), [0.5])


@given(pairs)
def test_overlap_is_symmetric_and_within_zero_and_one(boxes: tuple) -> None:
    a, b = boxes
    forward = overlap(a, b)
    np.testing.assert_array_equal(forward, overlap(b, a))
    assert (forward >= 0).all()
    assert (forward <= 1).all()


@given(pairs)
def test_overlap_is_one_exactly_for_equal_boxes(boxes: tuple) -> None:
    a, b = boxes
    np.testing.assert_array_equal(overlap(a, b) == 1, (a == b).all(axis=1))


@given(st.floats(-1e4, 1e4), st.floats(-1e4, 1e4), st.floats(1e-3, 1e4), st.floats(1e-3, 1e4))
def test_overlap_of_a_box_with_itself_is_exactly_one(x, y, w, h) -> None:
    assert overlap([[x, y, w, h]], [[x, y, w, h]])[0] == 1


@given(pairs)
def test_every_form_of_the_intersection_gives_the_same_overlap(boxes: tuple) -> None:
    p, t = columns_of(*boxes)
    for corners in ("continuous", "guarded", "inclusive", "lenient"):
        np.testing.assert_allclose(overlap_of(p, t, corners), overlap(*boxes), atol=1e-12)


@given(pairs, st.floats(0.01, 100))
def test_normalized_center_error_ignores_scale(boxes: tuple, factor: float) -> None:
    a, b = boxes
    scaled = normalized_center_error(a * factor, b * factor)
    np.testing.assert_allclose(scaled, normalized_center_error(a, b), rtol=1e-9, atol=1e-9)


@given(pairs)
def test_errors_are_zero_exactly_for_equal_centers(boxes: tuple) -> None:
    a, b = boxes
    same = (a[:, :2] + a[:, 2:] / 2 == b[:, :2] + b[:, 2:] / 2).all(axis=1)
    for function in (center_error, normalized_center_error):
        np.testing.assert_array_equal(function(a, b) == 0, same)
        np.testing.assert_array_equal(function(a, a), np.zeros(len(a)))


@pytest.mark.parametrize("function", FUNCTIONS)
@given(boxes=wild)
def test_inputs_stay_as_they_are(function, boxes) -> None:
    before = boxes.copy()
    boxes.setflags(write=False)
    function(boxes, boxes[::-1])
    np.testing.assert_array_equal(boxes, before)


@pytest.mark.parametrize("function", FUNCTIONS)
@pytest.mark.parametrize("column", range(4))
@pytest.mark.parametrize("side", [0, 1])
def test_nan_in_a_row_is_nan_for_that_row_only(function, column, side) -> None:
    boxes = [np.full((3, 4), 10.0), np.full((3, 4), 12.0)]
    boxes[side][1, column] = np.nan
    np.testing.assert_array_equal(np.isnan(function(*boxes)), [False, True, False])


def test_infinite_rows_overlap_as_nan() -> None:
    assert np.isnan(overlap([[np.inf] * 4], [[0, 0, 1, 1]])).all()


def test_boxes_without_area_overlap_nothing() -> None:
    flat = [[0, 0, 0, 5], [0, 0, -5, -5], [0, 0, 0, 0]]
    np.testing.assert_array_equal(overlap(flat, flat), [0, 0, 0])
    np.testing.assert_array_equal(overlap(flat, [[0, 0, 5, 5]] * 3), [0, 0, 0])


def test_normalized_error_needs_a_true_size() -> None:
    assert np.isnan(normalized_center_error([[0, 0, 5, 5]], [[0, 0, 0, 5]])).all()


@pytest.mark.parametrize("function", FUNCTIONS)
@pytest.mark.parametrize("empty", [[], np.empty((0, 4))])
def test_no_rows_give_no_values(function, empty) -> None:
    assert function(empty, empty).shape == (0,)


@pytest.mark.parametrize("function", FUNCTIONS)
@pytest.mark.parametrize("wrong", [[1, 2, 3, 4], [[1, 2, 3]], np.zeros((2, 4, 1)), 5])
def test_ill_formed_boxes_are_refused_by_name(function, wrong) -> None:
    right = [[0, 0, 1, 1]]
    if np.size(wrong):
        with pytest.raises(ArrayContract, match="predicted"):
            function(wrong, right)
        with pytest.raises(ArrayContract, match="truth"):
            function(right, wrong)
    with pytest.raises(ArrayContract, match="numbers"):
        function([["a", "b", "c", "d"]], right)


@pytest.mark.parametrize("function", FUNCTIONS)
def test_unequal_lengths_are_refused_with_both(function) -> None:
    with pytest.raises(LengthMismatch, match="2 rows, truth has 1"):
        function([[0, 0, 1, 1]] * 2, [[0, 0, 1, 1]])
