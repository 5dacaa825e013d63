import numpy as np
import pytest

from nat2024.errors import ArrayContract, UsageError
from nat2024.night import Darkening
from nat2024.night.arrays import smooth_noise


@pytest.fixture(scope="module")
def ground() -> np.ndarray:
    """A daytime picture with texture everywhere, larger than a frame."""
    rng = np.random.default_rng(0)
    noise = sum(smooth_noise(rng, (640, 480), scale) for scale in (40, 9, 4))
    grey = np.clip(120 + 25 * noise, 20, 235)
    return np.repeat(grey[..., None], 3, axis=2).astype(np.uint8)


def test_each_level_is_met_and_the_input_is_left_alone(ground):
    frame = ground[:270, :480].copy()
    before = frame.copy()
    levels = (0.15, 0.08, 0.04)
    made = Darkening(levels, seed=1).darken(frame)
    assert [image.mean() / 255 for image in made] == pytest.approx(levels, rel=0.12)
    assert np.array_equal(frame, before)
    assert all(image.shape == frame.shape and image.dtype == np.uint8 for image in made)


def test_the_seed_decides(ground):
    frame = ground[:270, :480]
    first = Darkening((0.1,), seed=4).darken(frame)[0]
    assert np.array_equal(first, Darkening((0.1,), seed=4).darken(frame)[0])
    assert not np.array_equal(first, Darkening((0.1,), seed=5).darken(frame)[0])


def test_lamps_keep_to_the_ground_when_the_camera_moves(ground):
    night = Darkening((0.1,), seed=3)
    images = []
    for step in range(21):
        x, y = 4 * step, 3 * step
        images.append(night.darken(ground[y : y + 270, x : x + 480])[0].astype(float))
    moved = images[-1][: 270 - 60, : 480 - 80]
    same_place = images[0][60:, 80:]
    stayed = images[0][: 270 - 60, : 480 - 80]
    assert np.abs(moved - same_place).mean() < 0.5 * np.abs(moved - stayed).mean()
    assert np.corrcoef(moved.ravel(), same_place.ravel())[0, 1] > 0.95


@pytest.mark.parametrize("levels", [(), (0.01,), (0.1, 0.6)])
def test_levels_out_of_range_are_refused(levels):
    with pytest.raises(UsageError, match=r"mean grey levels from 0\.03 to 0\.5"):
        Darkening(levels)


def test_frames_of_another_size_are_refused(ground):
    night = Darkening((0.1,))
    night.darken(ground[:270, :480])
    with pytest.raises(ArrayContract, match="frame 1 is 300x200, the first is not"):
        night.darken(ground[:200, :300])
    with pytest.raises(ArrayContract, match="uint8"):
        night.darken(ground[:270, :480].astype(float))


def test_plain_and_tiny_frames_pass():
    for image in (np.zeros((270, 480, 3), np.uint8), np.full((33, 40, 3), 255, np.uint8)):
        night = Darkening((0.1,))
        for _ in range(3):
            assert night.darken(image)[0].shape == image.shape
