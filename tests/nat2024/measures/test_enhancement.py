import dataclasses
import math

import numpy as np
import pytest

from nat2024.errors import ArrayContract
from nat2024.measures import light_spread, night_statistics
from nat2024.measures.enhancement import (
    ENHANCEMENT_MEASURES,
    EnhancementMeasures,
    flat_blocks,
    mean_measures,
    measure_enhancement,
)
from nat2024.measures.pixels import grey
from nat2024.testing.enhancers import night_image


def flat(level: int, size: tuple[int, int] = (64, 64)) -> np.ndarray:
    return np.full((*size, 3), level, np.uint8)


def noisy(level: float, sigma: float, size: tuple[int, int] = (96, 96)) -> np.ndarray:
    random = np.random.default_rng(0)
    values = level + random.normal(0, sigma, (*size, 1)).repeat(3, axis=2)
    return values.round().clip(0, 255).astype(np.uint8)


def test_every_field_is_explained() -> None:
    names = [field.name for field in dataclasses.fields(EnhancementMeasures)]
    assert names == list(ENHANCEMENT_MEASURES)
    row = measure_enhancement(night_image(64, 64), night_image(64, 64)).as_row()
    assert list(row) == names


def test_light_by_hand() -> None:
    before, after = flat(10), flat(51)
    before[:16] = 250  # a quarter bright and saturated
    after[:16] = 255
    found = measure_enhancement(before, after)
    assert found.mean_before == pytest.approx(70 / 255)
    assert found.mean_after == pytest.approx(102 / 255)
    assert found.spread_before == pytest.approx(240 * math.sqrt(3) / 4 / 255)
    assert (found.saturated_before, found.saturated_after) == (0.25, 0.25)
    assert (found.dark_before, found.dark_after) == (0.75, 0.0)
    assert found.bright_before == 0.25
    assert found.over_enhanced == 1.0
    assert found.over_enhanced_rise == pytest.approx(5 / 255)
    assert math.isnan(found.noise_gain)
    assert math.isnan(found.psnr)


@pytest.mark.parametrize(("rise", "share"), [(0, 0.0), (1, 0.0), (2, 0.5)])
def test_over_enhancement_needs_more_than_one_level(rise: int, share: float) -> None:
    before = flat(200)
    after = before.copy()
    after[:32] += rise
    found = measure_enhancement(before, after)
    assert found.over_enhanced == share
    assert found.over_enhanced_rise == pytest.approx(rise / 255 if share else 0.0)


def test_over_enhancement_is_not_defined_without_bright_pixels() -> None:
    found = measure_enhancement(flat(100), flat(200))
    assert math.isnan(found.over_enhanced)
    assert math.isnan(found.over_enhanced_rise)


def test_noise_grows_with_the_gain() -> None:
    before = noisy(40, 3)
    found = measure_enhancement(before, before * 3)
    assert found.noise_gain == pytest.approx(3.0)
    assert found.relative_noise_gain == pytest.approx(1.0)
    lifted = measure_enhancement(before, before + 100)
    assert lifted.noise_gain == pytest.approx(1.0)
    assert lifted.relative_noise_gain == pytest.approx(40 / 140, rel=0.01)


def test_noise_is_looked_for_where_it_is_flat() -> None:
    before = noisy(60, 2)
    before[:, :48] = np.random.default_rng(1).integers(0, 256, (96, 48, 1))  # texture
    before[:24] = 0  # cut off at black
    before[24:40, 48:] = 255
    chosen = flat_blocks(grey(before))
    assert chosen.any()
    assert not chosen[:, :6].any()
    assert not chosen[:5].any()
    after = before.copy()
    after[:, :48] //= 4  # what texture, black and white become does not count
    after[:24] = 77
    assert measure_enhancement(before, after).noise_gain == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize(
    "image",
    [flat(0), flat(128), flat(255), noisy(128, 60), night_image(5, 300), night_image(1, 1)],
    ids=["black", "grey", "white", "texture", "low", "one pixel"],
)
def test_images_without_flat_noise_have_no_noise_gain(image: np.ndarray) -> None:
    found = measure_enhancement(image, image)
    assert math.isnan(found.noise_gain)
    assert math.isnan(found.relative_noise_gain)
    assert np.isfinite(
        [found.mean_before, found.unevenness_after, found.local_contrast_after]
    ).all()


def test_contrast_and_unevenness_are_the_measures_of_night() -> None:
    before = night_image(90, 120)
    after = np.minimum(before.astype(int) * 2, 255).astype(np.uint8)
    found = measure_enhancement(before, after)
    for name in ("local_contrast", "relative_contrast"):
        assert getattr(found, f"{name}_before") == night_statistics(before)[name]
        assert getattr(found, f"{name}_after") == night_statistics(after)[name]
    assert found.unevenness_before == light_spread(before)
    assert found.unevenness_after == light_spread(after)


def test_channel_order_does_not_matter_and_inputs_stay() -> None:
    before, after = night_image(48, 64), night_image(48, 64, seed=1)
    copies = before.copy(), after.copy()
    one = measure_enhancement(before, after, after).as_row()
    turned = [np.ascontiguousarray(image[..., ::-1]) for image in (before, after, after)]
    other = measure_enhancement(*turned).as_row()
    assert other == pytest.approx(one, nan_ok=True)
    assert one["psnr"] == math.inf
    assert one["ssim"] == pytest.approx(1.0)
    assert np.array_equal(before, copies[0])
    assert np.array_equal(after, copies[1])


def test_means_leave_out_what_is_not_defined() -> None:
    rows = [{"a": 1.0, "b": math.nan, "c": math.nan}, {"a": 3.0, "b": 4.0, "c": math.nan}]
    means = mean_measures(rows)
    assert means == pytest.approx({"a": 2.0, "b": 4.0, "c": math.nan}, nan_ok=True)


def test_images_of_two_sizes_are_refused() -> None:
    with pytest.raises(ArrayContract, match="enhanced image and image differ in size"):
        measure_enhancement(flat(1), flat(1, (64, 65)))
    with pytest.raises(ArrayContract, match="reference and image differ"):
        measure_enhancement(flat(1), flat(1), flat(1, (64, 65)))
