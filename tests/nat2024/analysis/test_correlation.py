import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nat2024.analysis import rank_correlation
from nat2024.errors import ArrayContract, UsageError


def test_a_known_value_with_ties() -> None:
    # by hand: ranks 1, 2.5, 2.5, 4, 5 and 2, 1, 3, 5, 4
    found = rank_correlation([1, 2, 2, 3, 9], [20, 10, 30, 50, 40])
    assert found.value == pytest.approx(np.corrcoef([1, 2.5, 2.5, 4, 5], [2, 1, 3, 5, 4])[0, 1])
    assert np.isnan(found.low)  # too few
    assert not found.is_certain


def test_the_interval_is_seeded_and_tells_what_is_certain() -> None:
    random = np.random.default_rng(3)
    x = np.arange(40.0)
    related = rank_correlation(x, x + random.normal(0, 8, 40), resamples=2000)
    assert related.low < related.value < related.high
    assert related.is_certain
    assert related == rank_correlation(
        x, x + np.random.default_rng(3).normal(0, 8, 40), resamples=2000
    )
    unrelated = rank_correlation(x, random.permutation(40), resamples=2000)
    assert unrelated.low < 0 < unrelated.high


def test_pairs_with_a_nan_leave_and_constants_have_none() -> None:
    found = rank_correlation([1, 2, np.nan, 3], [1, 2, 3, np.nan])
    assert (found.value, found.pairs) == (pytest.approx(1.0), 2)
    for pair in (([], []), ([1], [1]), ([1, 1, 1, 1, 1, 1, 1], range(7))):
        assert np.isnan(rank_correlation(*pair).value)


def test_wrong_input_is_refused() -> None:
    with pytest.raises(ArrayContract):
        rank_correlation([1, 2], [1])
    with pytest.raises(UsageError):
        rank_correlation([1, 2], [1, 2], resamples=0)


@given(st.lists(st.tuples(st.integers(0, 5), st.integers(0, 5)), min_size=2, max_size=12))
def test_it_lies_in_bounds_and_depends_on_order_only(pairs: list[tuple[int, int]]) -> None:
    x, y = np.array(pairs, dtype=float).T
    value = rank_correlation(x, y, resamples=10).value
    if not np.isnan(value):
        assert -1 - 1e-9 <= value <= 1 + 1e-9
        assert rank_correlation(np.exp(x), y**3, resamples=10).value == pytest.approx(value)
        assert rank_correlation(-x, y, resamples=10).value == pytest.approx(-value)
