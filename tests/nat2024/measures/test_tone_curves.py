import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from nat2024.measures.tone_curves import LEVELS, CurveFit, apply_tone_curve

LEVEL = np.arange(LEVELS) / (LEVELS - 1)
IDENTITY = np.tile(LEVEL, (3, 1))


def as_image(values) -> np.ndarray:
    return np.asarray(values, dtype=np.float64).reshape(1, -1, 1).repeat(3, axis=2)


def fit(before: np.ndarray, after: np.ndarray) -> CurveFit:
    found = CurveFit()
    found.add(before, after)
    return found


def test_means_of_levels_are_the_curve_of_least_squares() -> None:
    before = as_image(np.array([10, 10, 10, 200]) / 255)
    found = fit(before, as_image([0.1, 0.2, 0.6, 0.9]))
    curve = found.solve()
    assert curve[:, 10] == pytest.approx(0.3)
    assert curve[:, 200] == pytest.approx(0.9)
    assert found.observed().sum() == 6


def test_unseen_levels_are_interpolated_and_end_in_the_identity() -> None:
    curve = fit(as_image(np.array([10, 110]) / 255), as_image([0.2, 0.6])).solve()[0]
    assert curve[60] == pytest.approx(0.4)
    assert curve[5] == pytest.approx(0.1)
    assert (curve[0], curve[255]) == (0.0, 1.0)
    assert CurveFit().solve() == pytest.approx(IDENTITY)


def test_seen_ends_are_kept() -> None:
    curve = fit(as_image([0.0, 1.0]), as_image([1.0, 0.0])).solve()
    assert curve == pytest.approx(1 - IDENTITY)


@given(st.lists(st.floats(0, 1), min_size=LEVELS, max_size=LEVELS), st.integers(0, 99))
@settings(max_examples=15, deadline=None)
def test_a_curve_is_found_again_also_from_values_between_levels(points, seed) -> None:
    curve = np.tile(np.array(points), (3, 1))
    random = np.random.default_rng(seed)
    before = as_image(np.concatenate([LEVEL, random.random(500)]))
    found = fit(before, apply_tone_curve(curve, before))
    assert found.observed().all()
    assert np.abs(found.solve() - curve).max() < 1e-6


def test_no_other_curve_comes_nearer() -> None:
    random = np.random.default_rng(0)
    before = as_image(random.random(2000))
    after = before**0.5 + random.normal(0, 0.05, before.shape)
    curve = fit(before, after).solve()

    def error(other):
        return np.sum((after - apply_tone_curve(other, before)) ** 2)

    least = error(curve)
    for _ in range(20):
        assert error(curve + random.normal(0, 0.01, curve.shape)) > least


def test_float32_levels_count_as_levels() -> None:
    before = as_image((np.arange(LEVELS, dtype=np.float32) / np.float32(255)).astype(float))
    assert fit(before, before).solve() == pytest.approx(IDENTITY, abs=1e-7)


def test_channels_have_their_own_curves() -> None:
    before = np.full((2, 2, 3), 0.2)
    after = before * (1, 2, 3)
    place = round(0.2 * 255)
    assert fit(before, after).solve()[:, place] == pytest.approx([0.2, 0.4, 0.6])


def test_memory_does_not_grow_with_images() -> None:
    together, apart = CurveFit(), CurveFit()
    images = [np.random.default_rng(seed).random((4, 6, 3)) for seed in range(2)]
    together.add(np.concatenate(images), np.concatenate(images) ** 2)
    for image in images:
        apart.add(image, image**2)
    assert apart.solve() == pytest.approx(together.solve())
