"""LIME as users create it: options, difficult images, and equality with the published ports."""

import time

import cv2
import numpy as np
import pytest
import torch

from nat2024.errors import ArrayContract, InvalidOption
from nat2024.images import image_to_batch
from nat2024.registry import create_enhancer
from nat2024.testing.enhancers import night_image

VARIANTS = ("texture", "windowed")
CASES = [
    (variant, name)
    for variant in VARIANTS
    for name in ("dt76_101x77", "dt36_127x127", "dt92_96x160")
]


@pytest.mark.shared
@pytest.mark.parametrize(("variant", "name"), CASES)
def test_maps_and_quotient_equal_the_published_ports(shared, variant, name):
    kit = shared / "parity" / "enhancers"
    image = cv2.imread(str(kit / "inputs" / f"{name}.png"))[..., ::-1]
    enhancer = create_enhancer("lime", variant=variant, clamp=False)
    batch = image_to_batch(image)
    maps = {**enhancer.maps(batch), "enhanced": enhancer.enhance_batch(batch)}
    with np.load(kit / "outputs" / "lime" / f"{name}_{variant}.npz") as stored:
        assert {"T_init", "T_gamma", "enhanced"} <= set(stored.files) <= set(maps)
        for key in stored.files:
            actual = maps[key][0].numpy()
            expected = stored[key].reshape(actual.shape)
            relative = 1e-4 if key in ("wx", "wy") else 0.0
            np.testing.assert_allclose(actual, expected, rtol=relative, atol=1e-5, err_msg=key)


@pytest.mark.parametrize("variant", VARIANTS)
@pytest.mark.parametrize("options", [{}, {"solver": "exact", "passes": 20}, {"symmetric": True}])
@pytest.mark.parametrize("size", [(1, 1), (3, 200), (33, 25)])
def test_black_white_and_unreal_pixels_do_no_harm(variant, options, size):
    enhancer = create_enhancer("lime", variant=variant, **options)
    black = np.zeros((*size, 3), np.uint8)
    assert not enhancer.enhance(black).any()
    assert (enhancer.enhance(black + 255) >= 240).all()
    batch = image_to_batch(night_image(*size))
    batch[0, :, 0, 0] = float("nan")
    enhanced = enhancer.enhance_batch(batch)
    assert enhanced.shape == batch.shape
    assert torch.isfinite(enhanced.flatten(2)[..., 1:]).all()


def test_settings_change_what_they_name():
    image = night_image(40, 56)
    base = create_enhancer("lime").maps(image_to_batch(image))
    for options, changed in (
        ({"alpha": 0.5}, "T_refined"),
        ({"sigma": 4.0}, "wx"),
        ({"eps": 0.1}, "wx"),
        ({"gamma": 0.5}, "T_gamma"),
        ({"solver": "exact"}, "T_refined"),
    ):
        maps = create_enhancer("lime", **options).maps(image_to_batch(image))
        assert torch.equal(maps["T_init"], base["T_init"])
        assert not torch.allclose(maps[changed], base[changed]), options
    printed = create_enhancer("lime", variant="windowed")
    symmetric = create_enhancer("lime", variant="windowed", symmetric=True)
    assert not np.array_equal(printed.enhance(image), symmetric.enhance(image))


def test_refined_light_stays_within_that_of_the_image():
    image = night_image(48, 64)
    for variant, key in (("texture", "T_refined"), ("windowed", "T_refined_clipped")):
        maps = create_enhancer("lime", variant=variant).maps(image_to_batch(image))
        assert maps[key].min() >= maps["T_init"].min() - 1e-5
        assert maps[key].max() <= maps["T_init"].max() + 1e-5
        assert maps[key].std() < maps["T_init"].std()


def test_clamp_and_quantise():
    image = night_image(24, 32)
    raw = create_enhancer("lime", clamp=False).enhance_batch(image_to_batch(image))
    assert raw.max() > 1
    cut = create_enhancer("lime", quantise="truncate").enhance(image)
    expected = (raw.clamp(0, 1)[0].permute(1, 2, 0) * 255).to(torch.uint8).numpy()
    assert np.array_equal(cut, expected)
    order = create_enhancer("lime").enhance(np.ascontiguousarray(image[..., ::-1]), bgr=True)
    assert np.array_equal(order[..., ::-1], create_enhancer("lime").enhance(image))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"alpha": -1.0}, "alpha must be a finite number of at least 0"),
        ({"sigma": 0.0}, r"sigma must be .* at least 0.1 and at most 100"),
        ({"eps": float("nan")}, "eps must be a finite number"),
        ({"gamma": float("inf")}, "gamma must be a finite number"),
        ({"passes": 0}, "passes must be at least 1"),
        ({"variant": "other"}, "variant"),
        ({"solver": "fast"}, "solver"),
    ],
)
def test_wrong_options_are_refused(options, message):
    with pytest.raises(InvalidOption, match=message):
        create_enhancer("lime", **options)


def test_wrong_batches_are_refused():
    with pytest.raises(ArrayContract):
        create_enhancer("lime").maps(torch.zeros(1, 4, 8, 8))


def test_time_grows_with_the_pixels_only():
    # a direct factorisation would take eight times as long for four times the pixels
    enhancer = create_enhancer("lime")
    seconds = {}
    for height, width in ((90, 160), (180, 320), (90, 160), (180, 320)):
        image = night_image(height, width)
        begin = time.process_time()
        enhancer.enhance(image)
        passed = time.process_time() - begin
        seconds[height] = min(passed, seconds.get(height, passed))
    assert seconds[180] < 7 * seconds[90]
