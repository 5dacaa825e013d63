import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nat2024.errors import ArrayContract
from nat2024.metrics import (
    NORMALIZED_PRECISION_THRESHOLDS,
    PRECISION_THRESHOLDS,
    SUCCESS_THRESHOLDS,
    normalized_precision_curve,
    precision_curve,
    success_curve,
)
from nat2024.metrics.curves import Grid, count_above, count_within, trapezoids
from nat2024.metrics.parts import Parts

CURVES = [success_curve, precision_curve, normalized_precision_curve]
GRIDS = {
    "success": SUCCESS_THRESHOLDS,
    "precision": PRECISION_THRESHOLDS,
    "normalized": NORMALIZED_PRECISION_THRESHOLDS,
    "success got10k": np.linspace(0, 1, 101)[::5],
    "normalized got10k": np.linspace(0, 0.5, 51),
    "precision trackingnet": np.linspace(0, 50, 21),
    "normalized trackingnet": np.linspace(0, 0.5, 21),
}


def around(thresholds: np.ndarray) -> np.ndarray:
    """Each threshold with the three float64 values on both sides of it."""
    values = [thresholds]
    for direction in (-np.inf, np.inf):
        beside = thresholds
        for _ in range(3):
            beside = np.nextafter(beside, direction)
            values.append(beside)
    return np.concatenate(values)


def test_thresholds_are_those_of_the_toolkits() -> None:
    np.testing.assert_array_equal(SUCCESS_THRESHOLDS, np.arange(0, 1.05, 0.05))
    np.testing.assert_array_equal(PRECISION_THRESHOLDS, np.arange(0, 51, 1))
    np.testing.assert_array_equal(NORMALIZED_PRECISION_THRESHOLDS, np.arange(0, 51, 1) / 100)
    assert not SUCCESS_THRESHOLDS.flags.writeable


@pytest.mark.parametrize("thresholds", GRIDS.values(), ids=GRIDS)
@given(
    more=st.lists(st.floats(allow_nan=True, allow_infinity=True), max_size=20),
    shares=st.lists(st.floats(0, 1), max_size=20),
)
def test_counts_equal_the_comparison(thresholds, more, shares) -> None:
    inside = np.array(shares) * thresholds[-1]
    values = np.concatenate([around(thresholds), np.array(more), inside, [np.nan, np.inf, -1]])
    table = values[:, None]
    grid, whole = Grid(thresholds), Parts.of([len(values)])
    above, reached = (table > thresholds).sum(0), (table >= thresholds).sum(0)
    within = (table <= thresholds).sum(0)
    with np.errstate(over="ignore"):
        np.testing.assert_array_equal(count_above(values, thresholds), above)
        np.testing.assert_array_equal(count_above(values, thresholds, inclusive=True), reached)
        np.testing.assert_array_equal(count_within(values, thresholds), within)
        np.testing.assert_array_equal(grid.count_above(values, whole), [above])
        np.testing.assert_array_equal(grid.count_above(values, whole, inclusive=True), [reached])
        np.testing.assert_array_equal(grid.count_within(values, whole), [within])


@given(st.lists(st.floats(0, 1), min_size=1, max_size=60))
def test_curves_are_monotone_shares(values) -> None:
    falling, rising = success_curve(values), precision_curve(np.array(values) * 60)
    assert (np.diff(falling) <= 0).all()
    assert (np.diff(rising) >= 0).all()
    assert (np.diff(normalized_precision_curve(values)) >= 0).all()
    for curve in (falling, rising):
        assert (curve >= 0).all()
        assert (curve <= 1).all()


def test_a_perfect_tracker_scores_twenty_of_twenty_one() -> None:
    assert success_curve(np.ones(7)).mean() == pytest.approx(20 / 21, abs=1e-15)
    assert success_curve(np.ones(7), inclusive=True).mean() == 1
    np.testing.assert_array_equal(precision_curve(np.zeros(7)), np.ones(51))
    np.testing.assert_array_equal(normalized_precision_curve(np.zeros(7)), np.ones(51))


def test_values_on_a_threshold_fail_success_and_pass_precision() -> None:
    np.testing.assert_array_equal(success_curve([0.5], [0.25, 0.5, 0.75]), [1, 0, 0])
    np.testing.assert_array_equal(precision_curve([2], [1, 2, 3]), [0, 1, 1])


def test_divisor_can_be_given() -> None:
    np.testing.assert_array_equal(success_curve([0.6, 0.6], [0.5], frames=4), [0.5])
    np.testing.assert_array_equal(precision_curve([1, 1], [5], frames=8), [0.25])


def test_nan_passes_nothing() -> None:
    assert not success_curve([np.nan], inclusive=True).any()
    assert not precision_curve([np.nan]).any()


@pytest.mark.parametrize("curve", CURVES)
def test_no_frames_give_nan(curve) -> None:
    assert np.isnan(curve([])).all()


@pytest.mark.parametrize("curve", CURVES)
def test_inputs_stay_as_they_are(curve) -> None:
    values = np.array([0.1, np.nan, 0.3])
    values.setflags(write=False)
    curve(values)


@pytest.mark.parametrize("curve", CURVES)
def test_ill_formed_input_is_refused(curve) -> None:
    with pytest.raises(ArrayContract, match=r"shape \(1, 2\)"):
        curve([[0.1, 0.2]])
    with pytest.raises(ArrayContract, match="ascending"):
        curve([0.1], [0.5, 0.2])


def test_trapezoid_of_a_ramp() -> None:
    ramps = np.array([np.linspace(0, 1, 21), np.ones(21)])
    assert trapezoids(ramps).tolist() == pytest.approx([0.5, 1], abs=1e-15)
