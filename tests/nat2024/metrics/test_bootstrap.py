"""Paired bootstrap over sequences: intervals of gains."""

import time
from dataclasses import fields

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from nat2024.metrics import FEWEST_SEQUENCES, PairedGains, paired_bootstrap

SCORES = st.integers(0, 1000).map(lambda number: number / 1000)
PAIRS = st.integers(1, 12).flatmap(
    lambda count: st.tuples(
        arrays.arrays(np.float64, count, elements=SCORES),
        arrays.arrays(np.float64, count, elements=SCORES),
    )
)
FEW = 200


def numbers(found: PairedGains) -> np.ndarray:
    return np.array([getattr(found, field.name) for field in fields(found)], dtype=np.float64)


def test_against_a_plain_loop() -> None:
    random = np.random.default_rng(3)
    value, base = random.random(9), random.random(9)
    found = paired_bootstrap(value, base, resamples=500, seed=4)
    chosen = np.random.default_rng([4, 9]).integers(9, size=(500, 9))
    differences, gains = [], []
    for draw in chosen:
        mean, base_mean = value[draw].mean(), base[draw].mean()
        differences.append(mean - base_mean)
        gains.append(100 * (mean - base_mean) / base_mean)
    low, high = np.percentile(differences, [2.5, 97.5])
    assert (found.difference_low, found.difference_high) == pytest.approx((low, high), abs=1e-11)
    expected = tuple(np.percentile(gains, [2.5, 97.5]))
    assert (found.gain_low, found.gain_high) == pytest.approx(expected, abs=1e-9)
    assert found.value == pytest.approx(value.mean())
    assert found.gain == pytest.approx(100 * (value.mean() - base.mean()) / base.mean())
    assert found.improved == pytest.approx(np.count_nonzero(value > base) / 9)


def test_weights_are_those_of_the_mean() -> None:
    value, base, frames = np.array([0.2, 0.8, 0.5]), np.array([0.1, 0.6, 0.9]), [10, 30, 60]
    found = paired_bootstrap(value, base, weights=frames, base_weights=frames, resamples=300)
    assert found.value == pytest.approx(np.average(value, weights=frames))
    chosen = np.random.default_rng([0, 3]).integers(3, size=(300, 3))
    weights = np.array(frames)[chosen]
    differences = (weights * (value - base)[chosen]).sum(axis=1) / weights.sum(axis=1)
    assert found.difference_low == pytest.approx(np.percentile(differences, 2.5), abs=1e-11)
    # a sequence without weight is drawn but counts nothing; draws of it alone have no mean
    left_out = paired_bootstrap(value[:2], base[:2], weights=[0, 1], base_weights=[0, 1])
    assert left_out.difference == left_out.difference_low == pytest.approx(0.2)


@given(PAIRS)
def test_the_interval_lies_within_the_sequences_and_turns_with_the_sides(
    pair: tuple[np.ndarray, np.ndarray],
) -> None:
    value, base = pair
    found = paired_bootstrap(value, base, resamples=FEW)
    turned = paired_bootstrap(base, value, resamples=FEW)
    assert found.difference == pytest.approx(-turned.difference, abs=1e-11)
    if len(value) == 1:
        assert np.isnan(found.difference_low)
    else:
        assert found.difference_low == pytest.approx(-turned.difference_high, abs=1e-11)
        lowest, highest = (value - base).min(), (value - base).max()
        assert lowest - 1e-9 <= found.difference_low <= found.difference_high <= highest + 1e-9
    assert not (found.certain and len(value) < FEWEST_SEQUENCES)
    assert found.improved + turned.improved <= 1 + 1e-12


@given(PAIRS, st.integers(0, 2**31))
def test_a_comparison_does_not_depend_on_its_company(
    pair: tuple[np.ndarray, np.ndarray], seed: int
) -> None:
    value, base = pair
    alone = paired_bootstrap(value, base, resamples=FEW)
    noise = np.random.default_rng(seed).random((3, 2, len(value)))
    noise[1, 0, 0] = np.nan
    noise[2, 1] = value
    together = paired_bootstrap(noise, np.broadcast_to(base, noise.shape), resamples=FEW)
    assert together.value.shape == (3, 2)
    mine = np.array([getattr(together, f.name)[2, 1] for f in fields(together)], dtype=np.float64)
    np.testing.assert_allclose(mine, numbers(alone), rtol=1e-12, atol=1e-10)


@given(PAIRS)
def test_sequences_without_a_score_leave(pair: tuple[np.ndarray, np.ndarray]) -> None:
    value, base = (np.concatenate([one, [np.nan, 0.5]]) for one in pair)
    base[-1] = np.nan
    more = paired_bootstrap(value, base, resamples=FEW)
    assert more.sequences == len(pair[0])
    without = numbers(paired_bootstrap(*pair, resamples=FEW))
    np.testing.assert_allclose(numbers(more), without, rtol=1e-12, atol=1e-10)


def test_equal_results_gain_nothing_for_certain() -> None:
    scores = np.random.default_rng(0).random(135)
    found = paired_bootstrap(scores, scores)
    assert found.difference == found.difference_low == found.difference_high == 0
    assert not found.certain
    assert found.improved == 0


def test_what_few_sequences_can_tell() -> None:
    base = np.linspace(0.2, 0.6, FEWEST_SEQUENCES)
    assert paired_bootstrap(base + 0.1, base).certain
    fewer = paired_bootstrap(base[1:] + 0.1, base[1:])
    assert fewer.difference_low == pytest.approx(0.1)
    assert not fewer.certain


def test_nothing_to_compare() -> None:
    empty = paired_bootstrap(np.empty((2, 0)), np.empty((2, 0)))
    assert empty.sequences.tolist() == [0, 0]
    assert np.isnan(empty.difference).all()
    nothing = paired_bootstrap([0.0, 0.0], [0.0, 0.0])
    assert np.isnan(nothing.gain)
    assert nothing.difference_low == 0
    sometimes = paired_bootstrap([0.5, 0.5], [0.0, 0.5])  # draws of the first alone have no gain
    assert (sometimes.gain_low, sometimes.gain_high) == (0, 100)


def test_coverage_is_near_what_it_says() -> None:
    random = np.random.default_rng(7)
    base = random.random((300, 40))
    value = base + random.normal(0.02, 0.1, base.shape)
    found = paired_bootstrap(value, base, resamples=1000)
    covered = (found.difference_low <= 0.02) & (found.difference_high >= 0.02)
    assert 0.90 <= covered.mean() <= 0.98


def test_a_benchmark_is_compared_at_once() -> None:
    random = np.random.default_rng(0)
    value, base = random.random((20, 3, 135)), random.random((3, 135))

    def seconds() -> float:
        start = time.perf_counter()
        paired_bootstrap(value, base)
        return time.perf_counter() - start

    assert min(seconds() for _ in range(3)) < 0.5  # 0.05 s where nobody else computes
