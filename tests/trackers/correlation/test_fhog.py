"""The vectorised histograms against the paper's formulas, written out as loops."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from nat2024_trackers.correlation.fhog import CHANNELS, FHOG, strongest_gradients


def slow_histograms(patch: np.ndarray, rows: int, columns: int, cell: int) -> np.ndarray:
    """(18, rows, columns): each pixel's gradient shared by the four cells around it."""
    height, width, channels = patch.shape
    found = np.zeros((18, rows, columns))
    for y in range(height):
        for x in range(width):
            best = (-1.0, 0.0, 0.0)
            for channel in range(channels):
                plane = patch[..., channel]
                dx = plane[y, min(x + 1, width - 1)] - plane[y, max(x - 1, 0)]
                dy = plane[min(y + 1, height - 1), x] - plane[max(y - 1, 0), x]
                if dx * dx + dy * dy > best[0]:
                    best = (dx * dx + dy * dy, dx, dy)
            energy, dx, dy = best
            direction = round(math.atan2(dy, dx) / math.radians(20)) % 18
            for row in range(rows):
                for column in range(columns):
                    down = 1 - abs((y + 0.5) / cell - (row + 0.5))
                    across = 1 - abs((x + 0.5) / cell - (column + 0.5))
                    if down > 0 and across > 0:
                        found[direction, row, column] += math.sqrt(energy) * down * across
    return found


def slow_features(patch: np.ndarray, rows: int, columns: int, cell: int) -> np.ndarray:
    """(31, rows, columns) by the definition, cell by cell."""
    signed = slow_histograms(patch, rows, columns, cell)
    unsigned = signed[:9] + signed[9:]
    energy = (unsigned**2).sum(axis=0)
    features = np.zeros((31, rows, columns))
    for row in range(rows):
        for column in range(columns):
            both = np.concatenate([unsigned[:, row, column], signed[:, row, column]])
            block = 0
            for up in (-1, 0):
                for left in (-1, 0):
                    total = 1e-4
                    for y in (row + up, row + up + 1):
                        for x in (column + left, column + left + 1):
                            total += energy[min(max(y, 0), rows - 1), min(max(x, 0), columns - 1)]
                    cut = np.minimum(both / math.sqrt(total), 0.2)
                    features[:27, row, column] += 0.5 * cut
                    features[27 + block, row, column] = 0.2357 * cut[9:].sum()
                    block += 1
    return features


@pytest.mark.parametrize(("rows", "columns", "cell"), [(2, 2, 4), (4, 3, 4), (3, 5, 2), (5, 2, 3)])
def test_it_equals_the_plain_form(rows, columns, cell):
    patch = np.random.default_rng(rows).integers(0, 256, (rows * cell, columns * cell, 3))
    found = FHOG(rows, columns, cell)(patch[None].astype(np.float32))
    expected = slow_features(patch.astype(np.float64), rows, columns, cell)
    assert found.dtype == np.float32
    assert found.shape == (1, CHANNELS, rows, columns)
    np.testing.assert_allclose(found[0], expected, atol=2e-5)


@settings(max_examples=25, deadline=None)
@given(hnp.arrays(np.uint8, (8, 12, 3), elements=st.integers(0, 255)))
def test_it_equals_the_plain_form_on_any_patch(patch):
    found = FHOG(2, 3, 4)(patch[None].astype(np.float32))[0]
    expected = slow_features(patch.astype(np.float64), 2, 3, 4)
    np.testing.assert_allclose(found, expected, atol=5e-5)


@settings(max_examples=25, deadline=None)
@given(hnp.arrays(np.uint8, (12, 12, 3)))
def test_values_are_bounded_and_inputs_unchanged(patch):
    given_patch = patch[None].astype(np.float32)
    kept = given_patch.copy()
    found = FHOG(3, 3, 4)(given_patch)
    np.testing.assert_array_equal(given_patch, kept)
    assert found.min() >= 0
    assert found[:, :27].max() <= 0.4 + 1e-6  # half of four values cut at 0.2
    assert found[:, 27:].max() <= 0.2357 * 18 * 0.2 + 1e-6


def test_several_patches_are_described_as_each_alone():
    patches = np.random.default_rng(3).integers(0, 256, (5, 16, 12, 3)).astype(np.float32)
    hog = FHOG(4, 3, 4)
    together = hog(patches)
    for patch, found in zip(patches, together, strict=True):
        np.testing.assert_allclose(hog(patch[None])[0], found, atol=1e-6)


def test_an_even_patch_has_no_gradients():
    assert not FHOG(4, 4, 4)(np.full((1, 16, 16, 3), 200, dtype=np.float32)).any()


def test_an_edge_falls_into_its_direction():
    patch = np.zeros((1, 16, 16, 3), dtype=np.float32)
    patch[:, :, 8:] = 100  # brighter to the right: direction 0
    features = FHOG(4, 4, 4)(patch)[0]
    assert features[0].max() > 0
    assert features[9].max() > 0
    assert not features[1:9].any()
    assert not features[10:27].any()


def test_the_strongest_channel_speaks():
    patch = np.zeros((1, 8, 8, 3), dtype=np.float32)
    patch[:, :, 4:, 0] = 10
    patch[:, 4:, :, 2] = 90
    magnitude, direction = strongest_gradients(patch)
    assert magnitude[0, 4, 4] == 90
    assert direction[0, 4, 4] == 4 or direction[0, 4, 4] == 5  # 90 degrees lies between 80 and 100
    assert magnitude[0, 0, 4] == 10
    assert direction[0, 0, 4] == 0


def test_strips_leave_no_seams():
    """A patch worked on in many strips has the features of one worked on at once."""
    patch = np.random.default_rng(5).integers(0, 256, (1, 64, 1024, 3)).astype(np.float32)
    whole = FHOG(16, 256, 4)(patch)
    narrow = FHOG(16, 20, 4)(np.ascontiguousarray(patch[:, :, :80]))
    np.testing.assert_allclose(whole[..., :18], narrow[..., :18], atol=1e-5)
