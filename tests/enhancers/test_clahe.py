import cv2
import numpy as np
import pytest
import torch

from nat2024.errors import ArrayContract, InvalidOption
from nat2024.images import batch_to_image, image_to_batch
from nat2024.registry import create_enhancer
from nat2024.testing.enhancers import night_image


@pytest.mark.parametrize("options", [{}, {"clip_limit": 4.0, "tiles": 3}])
def test_lightness_is_equalised_and_colour_stays(options):
    image = night_image(64, 96)
    lab = cv2.cvtColor(image, cv2.COLOR_RGB2Lab)
    tiles = options.get("tiles", 8)
    equaliser = cv2.createCLAHE(options.get("clip_limit", 2.0), (tiles, tiles))
    lab[..., 0] = equaliser.apply(np.ascontiguousarray(lab[..., 0]))
    expected = cv2.cvtColor(lab, cv2.COLOR_Lab2RGB)
    answer = create_enhancer("clahe", **options).enhance(image)
    assert np.array_equal(answer, expected)
    assert not np.array_equal(answer, image)


def test_bgr_images_have_their_own_lightness():
    enhancer = create_enhancer("clahe")
    bgr = np.ascontiguousarray(night_image(64, 96)[..., ::-1])
    right, wrong = enhancer.enhance(bgr, bgr=True), enhancer.enhance(bgr)
    assert not np.array_equal(right, wrong)


def test_batches_are_read_as_rgb_unless_they_are_to_be_turned():
    bgr = np.ascontiguousarray(night_image(64, 96)[..., ::-1])
    batch = image_to_batch(bgr)
    as_given = create_enhancer("clahe").enhance_batch(batch)
    turned = create_enhancer("clahe", channel_order="rgb").enhance_batch(batch)
    enhancer = create_enhancer("clahe")
    assert np.array_equal(batch_to_image(as_given), enhancer.enhance(bgr))
    assert np.array_equal(batch_to_image(turned), enhancer.enhance(bgr, bgr=True))


@pytest.mark.parametrize("size", [(1, 1), (1, 7), (7, 1), (2, 3), (5, 300)])
@pytest.mark.parametrize("tiles", [1, 8, 64])
def test_images_smaller_than_the_tiles_work(size, tiles):
    answer = create_enhancer("clahe", tiles=tiles).enhance(night_image(*size))
    assert answer.shape == (*size, 3)


def test_wrong_options_and_inputs_are_refused():
    with pytest.raises(InvalidOption, match="tiles must be at least 1"):
        create_enhancer("clahe", tiles=0)
    with pytest.raises(InvalidOption, match="clip_limit must be"):
        create_enhancer("clahe", clip_limit=0)
    with pytest.raises(ArrayContract):
        create_enhancer("clahe", channel_order="rgb").enhance_batch(torch.zeros(3, 4, 4))
