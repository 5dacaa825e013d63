import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from nat2024_trackers.correlation.fourier import (
    fast_size,
    gaussian_label,
    inverse,
    peak,
    transform,
)


@pytest.mark.parametrize("size", [(4, 4), (6, 10), (54, 50), (30, 48)])
def test_transform_is_rfft2(size):
    maps = np.random.default_rng(0).standard_normal((3, *size)).astype(np.float32)
    found = transform(maps)
    assert found.dtype == np.complex64
    np.testing.assert_allclose(found, np.fft.rfft2(maps), atol=2e-4)
    np.testing.assert_allclose(inverse(found[1], size[1]), maps[1], atol=1e-5)


@given(st.integers(0, 3000))
def test_fast_sizes_are_even_and_smooth(number):
    size = fast_size(number)
    assert size >= number
    assert size % 2 == 0
    for prime in (2, 3, 5):
        while size % prime == 0:
            size //= prime
    assert size == 1


@settings(max_examples=60, deadline=None)
@given(st.floats(-9, 9), st.floats(-11, 11))
def test_a_peak_between_cells_is_found_exactly(down, right):
    rows, columns = 20, 24
    y = (np.arange(rows)[:, None] - down + rows / 2) % rows - rows / 2
    x = (np.arange(columns)[None, :] - right + columns / 2) % columns - columns / 2
    response = np.exp(-0.5 * (y**2 + x**2) / 2.0**2).astype(np.float32)
    found = peak(transform(response[None])[0], response)
    assert found[0] == pytest.approx(down, abs=5e-3)
    assert found[1] == pytest.approx(right, abs=5e-3)
    assert found[2] == pytest.approx(1, abs=5e-3)


@pytest.mark.parametrize("value", [0.0, 3.0])
def test_a_flat_response_has_its_peak_at_the_origin(value):
    response = np.full((8, 10), value, dtype=np.float32)
    assert peak(transform(response[None])[0], response) == (0, 0, value)


def test_noise_keeps_the_peak_beside_its_largest_cell():
    response = np.random.default_rng(4).standard_normal((16, 16)).astype(np.float32)
    down, right, height = peak(transform(response[None])[0], response)
    row, column = np.unravel_index(response.argmax(), response.shape)
    assert abs((down - row + 8) % 16 - 8) <= 1
    assert abs((right - column + 8) % 16 - 8) <= 1
    assert height >= response.max() - 1e-4


def test_the_label_is_one_at_the_origin_and_wraps_around():
    label = gaussian_label(8, 12, 1.5)
    assert label[0, 0] == label.max() == 1
    assert label[1, 0] == label[-1, 0] == pytest.approx(np.exp(-0.5 / 1.5**2))
    assert label[0, 2] == label[0, -2]
