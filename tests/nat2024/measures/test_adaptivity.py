import math

import cv2
import numpy as np
import pytest

from nat2024.errors import ArrayContract
from nat2024.measures import adaptivity
from nat2024.measures.adaptivity import judge, measure_adaptivity
from nat2024.testing.enhancers import night_image

IMAGES = [night_image(96, 128, seed) // (1 + seed % 2) for seed in range(3)]

COARSE = [image // 6 * 6 for image in IMAGES]  # so that colours repeat, as they do in real nights


def of(function, images=IMAGES):
    return measure_adaptivity([(image, function(image / 255.0)) for image in images])


def test_one_curve_is_explained_whole() -> None:
    found = of(lambda x: np.stack([x[..., 0] ** 0.5, x[..., 1] ** 0.7, 1 - x[..., 2]], axis=-1))
    assert found.explained == pytest.approx(1.0, abs=1e-12)
    assert found.verdict == adaptivity.FIXED
    assert found.max_residual < 1e-12
    assert max(found.gain_inside, found.gain_between) < 1e-12
    seen = found.observed[0]
    assert found.curve[0][seen] == pytest.approx((np.arange(256) / 255)[seen] ** 0.5)


def test_nothing_done_is_no_effect() -> None:
    found = of(lambda x: x + 1e-5)
    assert found.verdict == adaptivity.NONE
    assert math.isnan(found.explained)
    assert found.effect == pytest.approx(1e-5)


def test_a_curve_for_each_image_adapts_between_images() -> None:
    found = of(lambda x: x ** (0.4 + x.mean()))
    assert found.explained < 0.999
    assert found.explained_by_image_curves == pytest.approx(1.0, abs=1e-9)
    assert found.gain_inside < 1e-9
    assert found.gain_between > 0.02
    assert found.verdict == adaptivity.BETWEEN


def mean_gain(x):
    """A gain that depends on the three channels only: no curve of a channel, yet fixed."""
    warm = x[..., :1] > 1.15 * x[..., 2:]
    return x * np.where(warm, 1.0, 3.0)


def test_a_fixed_function_of_colour_is_told_from_a_curve() -> None:
    found = of(mean_gain, COARSE)
    assert found.explained < 0.999
    assert found.explained_by_colour == pytest.approx(1.0, abs=1e-9)
    assert found.verdict == adaptivity.FIXED_COLOURS


def test_colours_that_are_mapped_anew_for_each_image_adapt_between_images() -> None:
    found = of(lambda x: mean_gain(x) * (0.2 + 4 * x.mean()), COARSE)
    assert found.explained_by_image_colour == pytest.approx(1.0, abs=1e-9)
    assert found.explained_by_colour < 0.999
    assert found.verdict == adaptivity.BETWEEN


def test_a_gain_by_place_adapts_inside_images() -> None:
    ramp = np.linspace(1, 2, 128)[None, :, None]
    found = of(lambda x: x * ramp, COARSE)
    assert found.verdict == adaptivity.INSIDE
    assert found.explained_by_image_colour < 0.999
    assert found.gain_inside > 0.05


def test_a_gain_that_falls_where_surroundings_are_bright() -> None:
    def suppress(x):
        local = cv2.blur(x.mean(axis=2), (7, 7))[..., None]
        return x * 2 * (local + 0.02) ** -0.5

    found = of(suppress, COARSE)
    assert found.verdict == adaptivity.INSIDE
    assert found.gain_per_stop < -0.05
    assert abs(of(lambda x: 2 * x).gain_per_stop) < 1e-9


def test_the_border_counts_in_nothing_else() -> None:
    def ring(x):
        answer = x**0.5
        answer[:2], answer[-2:], answer[:, :2], answer[:, -2:] = 1, 1, 1, 1
        return answer

    found = of(ring)
    assert found.explained == pytest.approx(1.0, abs=1e-12)
    assert found.verdict == adaptivity.FIXED
    assert found.max_residual < 1e-12
    assert found.border_max_residual > 0.5
    assert found.border_mean_residual > 0.1


def test_noise_is_no_adaptation_between_colours_by_chance() -> None:
    random = np.random.default_rng(0)
    images = [random.integers(0, 12, (64, 64, 3), dtype=np.uint8) for _ in range(2)]
    found = of(lambda x: x + random.normal(0, 0.1, x.shape), images)
    # nearly all colours are rare, so that fitted means alone would seem to explain a half
    assert abs(found.explained_by_image_colour) < 0.1
    assert found.verdict == adaptivity.INSIDE


def test_few_repeated_colours_can_show_that_place_matters() -> None:
    found = of(lambda x: x * np.linspace(1, 2, 128)[None, :, None])
    assert math.isnan(found.explained_by_image_colour)
    assert found.verdict == adaptivity.INSIDE


@pytest.mark.parametrize("count", [1, 2])
def test_where_no_colour_repeats_nothing_is_said_of_places(count) -> None:
    random = np.random.default_rng(0)
    images = [random.integers(0, 256, (64, 64, 3), dtype=np.uint8) for _ in range(count)]
    found = of(lambda x: x.mean(axis=-1, keepdims=True).repeat(3, axis=-1), images)
    assert math.isnan(found.explained_by_image_colour)
    assert found.verdict == adaptivity.UNTOLD  # it is a fixed colour map, but nothing shows it


def test_uint8_answers_and_one_image() -> None:
    image = IMAGES[0]
    table = (255 * (np.arange(256) / 255) ** 0.5).round().astype(np.uint8)
    found = measure_adaptivity([(image, table[image])])
    assert found.explained == pytest.approx(1.0, abs=1e-12)
    assert found.verdict == adaptivity.SINGLE
    row = found.as_row()
    assert "curve" not in row
    assert row["images"] == 1


@pytest.mark.parametrize(
    ("shares", "verdict"),
    [
        ((0.999, 1.0, 1.0), adaptivity.FIXED),
        ((0.998, 0.999, 1.0), adaptivity.FIXED_COLOURS),
        ((0.998, 0.998, 0.999), adaptivity.BETWEEN),
        ((0.998, math.nan, 0.999), adaptivity.BETWEEN),
        ((0.998, 0.998, 0.998), adaptivity.INSIDE),
        ((0.998, math.nan, math.nan), adaptivity.UNTOLD),
    ],
)
def test_verdicts_follow_the_thresholds(shares, verdict) -> None:
    assert judge(2, 0.1, *shares) == verdict
    assert judge(2, 0.0001, *shares) == adaptivity.NONE


def test_what_cannot_be_measured_is_refused() -> None:
    with pytest.raises(ArrayContract, match="at least one pair"):
        measure_adaptivity([])
    with pytest.raises(ArrayContract, match="at least 5x5"):
        of(lambda x: x, [night_image(4, 90)])
    with pytest.raises(ArrayContract, match="differ in shape"):
        measure_adaptivity([(IMAGES[0], IMAGES[0][:-1])])
    with pytest.raises(ArrayContract, match="not finite"):
        of(lambda x: x * math.nan)
    with pytest.raises(ArrayContract, match="must be uint8 or floats"):
        measure_adaptivity([(IMAGES[0], IMAGES[0].astype(int))])


def test_small_images_beside_larger_ones_are_no_error() -> None:
    found = of(lambda x: x**0.5, [night_image(1, 1), *IMAGES])
    assert found.verdict == adaptivity.FIXED
    assert found.images == 4
