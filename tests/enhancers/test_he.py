import cv2
import numpy as np
import pytest
import torch

from nat2024.errors import ArrayContract
from nat2024.images import batch_to_image, image_to_batch
from nat2024.registry import create_enhancer
from nat2024.testing.enhancers import night_image


def test_luminance_is_equalised_by_definition_and_chroma_stays():
    image = night_image(64, 96)
    luma = cv2.cvtColor(image, cv2.COLOR_RGB2YCrCb)
    counts = np.bincount(luma[..., 0].ravel(), minlength=256)
    sums, lowest = counts.cumsum(), counts[counts > 0][0]
    table = np.rint((sums - lowest) / (counts.sum() - lowest) * 255).clip(0, 255).astype(np.uint8)
    luma[..., 0] = table[luma[..., 0]]
    expected = cv2.cvtColor(luma, cv2.COLOR_YCrCb2RGB).astype(int)
    answer = create_enhancer("he").enhance(image)
    assert np.abs(answer - expected).max() <= 1
    assert answer.mean() > 2 * image.mean()


def test_bgr_images_have_their_own_luminance():
    enhancer = create_enhancer("he")
    bgr = np.ascontiguousarray(night_image(64, 96)[..., ::-1])
    assert not np.array_equal(enhancer.enhance(bgr, bgr=True), enhancer.enhance(bgr))


def test_batches_are_read_as_rgb_unless_they_are_to_be_turned():
    bgr = np.ascontiguousarray(night_image(64, 96)[..., ::-1])
    batch = image_to_batch(bgr)
    as_given = create_enhancer("he").enhance_batch(batch)
    turned = create_enhancer("he", channel_order="rgb").enhance_batch(batch)
    enhancer = create_enhancer("he")
    assert np.array_equal(batch_to_image(as_given), enhancer.enhance(bgr))
    assert np.array_equal(batch_to_image(turned), enhancer.enhance(bgr, bgr=True))


@pytest.mark.parametrize("level", [0, 37, 255])
def test_flat_images_stay(level):
    image = np.full((5, 7, 3), level, np.uint8)
    assert np.array_equal(create_enhancer("he").enhance(image), image)


def test_wrong_inputs_are_refused():
    with pytest.raises(ArrayContract):
        create_enhancer("he", channel_order="rgb").enhance_batch(torch.zeros(3, 4, 4))
