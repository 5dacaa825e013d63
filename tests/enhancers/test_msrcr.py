import cv2
import numpy as np
import pytest
import torch

from nat2024.errors import InvalidOption
from nat2024.images import image_to_batch
from nat2024.registry import create_enhancer
from nat2024.testing.enhancers import night_image
from nat2024_enhancers.msrcr import gaussian_surroundings


def surroundings(values: np.ndarray, sigma: float) -> np.ndarray:
    return cv2.GaussianBlur(values, (0, 0), sigma, borderType=cv2.BORDER_REFLECT)


def by_definition(image: np.ndarray, gain: float = 46.0, offset: float = 0.0) -> np.ndarray:
    """Jobson et al. (1997) in float64 with whole Gaussians, stretched between percentiles."""
    values = image.astype(np.float64) + 1
    retinex = sum(np.log(values) - np.log(surroundings(values, sigma)) for sigma in (15, 80, 250))
    colour = gain * np.log(125 * values / values.sum(axis=2, keepdims=True))
    restored = colour * retinex / 3 + offset
    low, high = np.percentile(restored, (1, 99), axis=(0, 1))
    return ((restored - low) / (high - low)).clip(0, 1)


@pytest.mark.parametrize("size", [(127, 127), (96, 200), (37, 53)])
def test_images_are_restored_as_published(size):
    image = night_image(*size)
    answer = create_enhancer("msrcr").enhance_batch(image_to_batch(image))[0].numpy()
    difference = np.abs(answer.transpose(1, 2, 0) - by_definition(image))
    assert difference.mean() < 0.01 / 255
    assert difference.max() < 0.05 / 255


def test_gain_and_offset_of_the_paper_have_no_effect():
    image = night_image(48, 48)
    assert by_definition(image, 192.0, -30.0) == pytest.approx(by_definition(image), abs=1e-9)


@pytest.mark.parametrize("sigma", [15.0, 80.0, 250.0])
@pytest.mark.parametrize("size", [(127, 127), (90, 301)])
def test_fast_surroundings_are_the_gaussian_ones(sigma, size):
    values = night_image(*size).astype(np.float32) + 1
    exact = surroundings(values.astype(np.float64), sigma)
    fast = gaussian_surroundings(values, sigma)
    assert np.abs(fast / exact - 1).max() < 0.001


@pytest.mark.parametrize("level", [0, 90, 255])
def test_flat_images_stay(level):
    image = np.full((40, 50, 3), level, np.uint8)
    assert np.array_equal(create_enhancer("msrcr").enhance(image), image)


def test_all_values_are_used_and_more_are_cut_off_with_a_larger_clip():
    batch = image_to_batch(night_image(64, 64))
    shares = []
    for clip in (0.0, 1.0, 10.0):
        answer = create_enhancer("msrcr", clip=clip).enhance_batch(batch)
        assert (answer.min().item(), answer.max().item()) == (0.0, 1.0)
        shares.append(((answer == 0) | (answer == 1)).float().mean().item())
    assert shares[0] < 0.01
    assert shares[1] == pytest.approx(0.02, abs=0.005)
    assert shares[2] == pytest.approx(0.2, abs=0.01)


def test_more_colour_with_a_smaller_alpha():
    batch = image_to_batch(night_image(64, 64))
    answers = [create_enhancer("msrcr", alpha=alpha).enhance_batch(batch) for alpha in (5.0, 125.0)]
    assert not torch.allclose(*answers, atol=0.01)


def test_values_that_are_not_finite_harm_nothing():
    batch = image_to_batch(night_image(24, 24))
    batch[0, :, 3, 4] = float("nan")
    assert torch.isfinite(create_enhancer("msrcr").enhance_batch(batch)).all()


def test_wrong_options_are_refused():
    with pytest.raises(InvalidOption, match="alpha must be"):
        create_enhancer("msrcr", alpha=0.0)
    with pytest.raises(InvalidOption, match="clip must be"):
        create_enhancer("msrcr", clip=50.0)
