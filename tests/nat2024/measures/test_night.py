from pathlib import Path

import numpy as np
import pytest

from nat2024.errors import ArrayContract
from nat2024.measures import NIGHT_MEASURES, block_statistics, night_statistics, resize_area
from nat2024.measures.night import noise_sigma

# Median, 10th and 90th percentile of 22 real night UAV frames, measured apart from this code.
REAL_NIGHT = {
    "mean": (0.074, 0.049, 0.116),
    "p25": (0.022, 0.014, 0.040),
    "p50": (0.043, 0.024, 0.076),
    "p95": (0.220, 0.135, 0.389),
    "p99": (0.461, 0.243, 0.626),
    "p99_9": (0.772, 0.554, 0.932),
    "dark_share": (0.905, 0.771, 0.966),
    "bright_share": (0.0016, None, None),
    "saturated_share": (0.0002, None, 0.0009),
    "local_contrast": (0.030, 0.020, 0.046),
    "relative_contrast": (0.202, 0.144, 0.327),
    "unevenness": (0.88, 0.70, 1.08),
    "block_ratio": (3.1, 2.3, 5.4),
    "noise_sigma": (0.0018, 0.0012, 0.0021),
    "red_green": (1.01, 0.97, 1.16),
    "blue_green": (0.92, 0.75, 1.09),
    "mean_gradient": (0.011, 0.007, 0.017),
    "step_share": (0.038, 0.020, 0.079),
}


def flat(level: int, size: tuple[int, int] = (256, 256)) -> np.ndarray:
    return np.full((size[1], size[0], 3), level, np.uint8)


@pytest.mark.shared
def test_real_night_frames_have_the_known_statistics(shared: Path) -> None:
    import cv2

    paths = sorted((shared / "realdata" / "night_first_frames").glob("*.jpg"))
    rows = [night_statistics(cv2.imread(str(path))) for path in paths]
    assert len(rows) == 22
    for name, expected in REAL_NIGHT.items():
        found = np.percentile([row[name] for row in rows], (50, 10, 90))
        for value, wanted in zip(found, expected, strict=True):
            if wanted is not None:
                # half a unit of the last digit of a number with two digits, and 2 % for noise_sigma
                assert value == pytest.approx(wanted, rel=0.05, abs=0.00006), name


def test_every_measure_is_explained_and_finite_on_a_black_image() -> None:
    statistics = night_statistics(flat(0))
    assert list(statistics) == list(NIGHT_MEASURES)
    assert np.isfinite(list(statistics.values())).all()
    assert statistics.pop("dark_share") == 1
    assert set(statistics.values()) == {0.0}


def test_two_halves() -> None:
    image = flat(51)
    image[:, 128:] = 204
    image[:, 128:, 2] = 255
    statistics = night_statistics(image)
    right = (204 + 204 + 255) / 765
    assert statistics["mean"] == pytest.approx((0.2 + right) / 2)
    assert statistics["bright_share"] == statistics["saturated_share"] == 0.5
    assert statistics["dark_share"] == 0
    assert statistics["local_contrast"] < 1e-12
    assert statistics["red_green"] == pytest.approx((51 + 255) / (51 + 204))
    assert statistics["step_share"] == pytest.approx(1 / 255)
    assert statistics["mean_gradient"] == pytest.approx((right - 0.2) / 255)
    assert statistics["unevenness"] == pytest.approx(
        (right - 0.2) / 2 / (statistics["mean"] + 0.001)
    )


@pytest.mark.parametrize("sigma", [0.004, 0.02])
def test_noise_is_recovered_beside_ramps_and_edges(sigma: float) -> None:
    y, x = np.mgrid[:256, :256] / 255
    clean = 0.3 + 0.2 * x + 0.1 * y + 0.3 * (x > 0.7)
    noisy = clean + np.random.default_rng(0).normal(0, sigma, clean.shape)
    assert noise_sigma(noisy) == pytest.approx(sigma, rel=0.15)  # flat blocks are quiet ones
    assert noise_sigma(clean) < 1e-4


def test_size_of_the_image_does_not_matter_for_light() -> None:
    coarse = np.random.default_rng(1).integers(0, 200, (16, 16, 3), np.uint8)
    once = night_statistics(np.repeat(np.repeat(coarse, 16, 0), 16, 1))
    twice = night_statistics(np.repeat(np.repeat(coarse, 32, 0), 32, 1))
    assert once == twice


def test_image_is_not_modified_and_size_is_width_first() -> None:
    image = np.random.default_rng(2).integers(0, 255, (90, 160, 3), np.uint8)
    copy = image.copy()
    night_statistics(image)
    assert (image == copy).all()
    assert resize_area(image, (40, 30)).shape == (30, 40, 3)


@pytest.mark.parametrize("image", [np.zeros((4, 4)), np.zeros((4, 4, 3)), "x", flat(0, (0, 4))])
def test_what_is_no_image_is_refused(image: object) -> None:
    with pytest.raises(ArrayContract, match="uint8"):
        night_statistics(image)  # type: ignore[arg-type]


def test_too_small_a_size_is_refused() -> None:
    with pytest.raises(ArrayContract, match="at least 16x16"):
        night_statistics(flat(3), (256, 8))
    with pytest.raises(ArrayContract, match="no block of 9x9 fits into 8x9"):
        block_statistics(np.zeros((9, 8)), 9)


def test_block_statistics_leave_out_what_is_no_whole_block() -> None:
    values = np.arange(30.0).reshape(5, 6)
    means, deviations = block_statistics(values, 4)
    assert means.shape == deviations.shape == (1, 1)
    assert means[0, 0] == values[:4, :4].mean()
    assert deviations[0, 0] == values[:4, :4].std()
