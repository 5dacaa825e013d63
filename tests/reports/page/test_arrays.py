"""Numbers in few bytes come back as what they were."""

import base64

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nat2024_reports.page import arrays

series = st.lists(st.one_of(st.floats(0, 1), st.just(np.nan)), min_size=1, max_size=300)


@given(series)
def test_overlaps_keep_losses_and_gaps(values: list[float]) -> None:
    given_values = np.array(values)
    steps = arrays.overlap_bytes(given_values)
    known = ~np.isnan(given_values)
    assert np.array_equal(steps == 255, ~known)
    assert np.array_equal(steps[known] == 0, given_values[known] == 0)
    back = steps[known] / arrays.OVERLAP_STEPS
    assert np.abs(back - given_values[known]).max(initial=0) <= 1 / arrays.OVERLAP_STEPS


def test_errors_and_shares_at_their_ends() -> None:
    words = arrays.error_words([0, 20.04, 1e9, np.nan, np.inf])
    assert words.tolist() == [0, 200, 65534, 65535, 65535]
    assert arrays.share_words([0, 0.5, 1, 1.2, np.nan]).tolist() == [0, 32767, 65534, 65534, 65535]


def test_text_has_the_low_byte_first() -> None:
    assert base64.b64decode(arrays.encode(np.array([1, 258], np.uint16))) == b"\x01\x00\x02\x01"


@given(series, st.integers(2, 50))
def test_shortening_keeps_the_highest_and_the_lowest(values: list[float], points: int) -> None:
    given_values = np.array(values)
    short = arrays.extremes(given_values, points)
    assert len(short) == len(arrays.sample_frames(len(values), points))
    assert len(short) <= max(2, points + 1)
    assert np.isnan(given_values).all() == np.isnan(short).all()
    if not np.isnan(given_values).all():
        assert np.nanmax(short) == np.nanmax(given_values)
        assert np.nanmin(short) == np.nanmin(given_values)


@pytest.mark.parametrize("length", [1, 7, 100, 101, 4571])
def test_drawn_frames_lie_in_the_sequence_and_in_order(length: int) -> None:
    frames = arrays.sample_frames(length, 100)
    assert frames.min() >= 0
    assert frames.max() < length
    assert (np.diff(frames) >= 0).all()


def test_extremes_come_in_the_order_of_the_series() -> None:
    assert arrays.extremes([0, 0.2, 1, 0.5, 1, 0.5, 0.2, 0], 4).tolist() == [0, 1, 1, 0]
