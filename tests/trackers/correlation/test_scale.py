import numpy as np
import pytest

from nat2024_trackers.correlation.samples import cut
from nat2024_trackers.correlation.scale import FINE_SCALES, STEP, ScaleFilter


@pytest.fixture(scope="module")
def texture():
    """Smooth blobs, uint8 (240, 240, 3)."""
    import cv2

    noise = np.random.default_rng(6).integers(0, 256, (30, 30, 3), dtype=np.uint8)
    return cv2.resize(noise, (240, 240), interpolation=cv2.INTER_CUBIC)


@pytest.mark.parametrize("steps", [-8, -4, -2, 0, 2, 4, 8])
@pytest.mark.parametrize("size", [(60.0, 60.0), (40.0, 90.0)])
def test_a_known_change_of_size_is_found(texture, steps, size):
    scale = ScaleFilter(size)
    scale.learn(texture, (120.0, 120.0), size)
    extent = 240 / STEP**steps
    larger = cut(texture, (120.0, 120.0), (extent, extent), (240, 240))
    found = np.log(scale.factor(larger, (120.0, 120.0), size)) / np.log(STEP)
    assert round(found) == pytest.approx(steps, abs=1)


def test_nothing_changes_on_the_learned_patch(texture):
    scale = ScaleFilter((50.0, 30.0))
    scale.learn(texture, (100.0, 90.0), (50.0, 30.0))
    assert scale.factor(texture, (100.0, 90.0), (50.0, 30.0)) == 1.0


@pytest.mark.parametrize("learned", [False, True])
def test_an_even_patch_gives_a_factor_within_the_scales(learned):
    even = np.full((80, 80, 3), 9, dtype=np.uint8)
    scale = ScaleFilter((20.0, 20.0))
    if learned:
        scale.learn(even, (40.0, 40.0), (20.0, 20.0))
    factor = scale.factor(even, (40.0, 40.0), (20.0, 20.0))
    assert abs(np.log(factor) / np.log(STEP)) <= FINE_SCALES // 2 + 1e-9


def test_learning_moves_slowly(texture):
    """One look at another pattern does not replace what was learned."""
    size = (60.0, 60.0)
    scale = ScaleFilter(size)
    scale.learn(texture, (120.0, 120.0), size)
    scale.learn(texture[::-1], (100.0, 100.0), size)
    assert scale.factor(texture, (120.0, 120.0), size) == 1.0
