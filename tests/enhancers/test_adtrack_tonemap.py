import math

import numpy as np
import pytest
import torch

from nat2024.errors import InvalidOption
from nat2024.images import image_to_batch
from nat2024.registry import create_enhancer
from nat2024.testing.enhancers import night_image


def by_formula(rgb: np.ndarray) -> np.ndarray:
    """The tone mapping, one pixel after the other."""
    light = 0.299 * rgb[..., 0] + 0.587 * rgb[..., 1] + 0.114 * rgb[..., 2]
    average = math.exp(np.mean([math.log(0.001 + value) for value in light.ravel()]))
    answer = np.zeros_like(rgb)
    for place in np.ndindex(light.shape):
        if light[place] > 0:
            mapped = math.log(light[place] / average + 1) / math.log(light.max() / average + 1)
            answer[place] = np.minimum(rgb[place] * mapped / light[place], 1)
    return answer


def test_two_pixels_by_hand():
    batch = torch.tensor([0.0, 1.0]).view(1, 1, 1, 2).repeat(1, 3, 1, 1)
    batch[0, :, 0, 0] = 0.1
    average = math.sqrt(0.101 * 1.001)
    expected = math.log(0.1 / average + 1) / math.log(1 / average + 1)
    answer = create_enhancer("adtrack_tonemap").enhance_batch(batch)
    assert answer[0, :, 0, 0].tolist() == pytest.approx([expected] * 3, abs=1e-6)
    assert answer[0, :, 0, 1].tolist() == pytest.approx([1.0] * 3, abs=1e-6)


def test_images_are_mapped_as_the_formula_says():
    image = night_image(11, 13)
    answer = create_enhancer("adtrack_tonemap").enhance_batch(image_to_batch(image))
    expected = by_formula(image / 255.0).transpose(2, 0, 1)
    assert np.abs(answer[0].numpy() - expected).max() < 1e-5
    assert answer.mean() > 1.5 * image_to_batch(image).mean()


def test_every_image_of_a_batch_has_its_own_curve():
    one, other = image_to_batch(night_image(8, 9)), image_to_batch(night_image(8, 9) // 4)
    enhancer = create_enhancer("adtrack_tonemap")
    together = enhancer.enhance_batch(torch.cat([one, other]))
    assert torch.allclose(together[1:], enhancer.enhance_batch(other), atol=1e-6)


@pytest.mark.parametrize("level", [0, 255])
def test_black_stays_black_and_white_white(level):
    image = np.full((3, 4, 3), level, np.uint8)
    enhancer = create_enhancer("adtrack_tonemap")
    assert np.array_equal(enhancer.enhance(image), image)
    assert torch.isfinite(enhancer.enhance_batch(image_to_batch(image))).all()


def test_black_pixels_beside_others_stay_black():
    image = night_image(8, 8)
    image[2, 3] = 0
    assert not create_enhancer("adtrack_tonemap").enhance(image)[2, 3].any()


def test_only_dark_leaves_light_images_as_they_are():
    dark, light = (torch.full((1, 3, 4, 4), value) for value in (0.1, 0.2))
    for batch in (dark, light):
        batch[..., 0, 0] = 0.9
    both = torch.cat([dark, light])
    enhancer = create_enhancer("adtrack_tonemap", only_dark=True)
    answer = enhancer.enhance_batch(both)
    assert torch.equal(answer[1], both[1])
    assert answer[0].mean() > 2 * both[0].mean()
    all_light = create_enhancer("adtrack_tonemap", only_dark=True, threshold=0.05)
    assert torch.equal(all_light.enhance_batch(both), both)
    assert not torch.equal(create_enhancer("adtrack_tonemap").enhance_batch(both)[1], both[1])


def test_bgr_batches_can_be_turned():
    image = night_image(16, 20)
    batch = image_to_batch(image, reverse=True)
    turned = create_enhancer("adtrack_tonemap", channel_order="rgb")
    expected = by_formula(image / 255.0).transpose(2, 0, 1)[::-1]
    assert np.abs(turned.enhance_batch(batch)[0].numpy() - expected).max() < 1e-5
    plain = create_enhancer("adtrack_tonemap").enhance_batch(batch)[0].numpy()
    assert np.abs(plain - expected).max() > 1e-3
    assert np.array_equal(turned.enhance(image), create_enhancer("adtrack_tonemap").enhance(image))


def test_wrong_thresholds_are_refused():
    with pytest.raises(InvalidOption, match=r"threshold must be in 0\.\.1, not 2"):
        create_enhancer("adtrack_tonemap", threshold=2.0)
