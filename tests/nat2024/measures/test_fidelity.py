import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from nat2024.errors import ArrayContract
from nat2024.measures.fidelity import psnr, ssim


def noise(seed: int, size: tuple[int, int] = (16, 18)) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 256, (*size, 3), dtype=np.uint8)


def ssim_by_definition(first: np.ndarray, second: np.ndarray) -> float:
    """Wang et al. (2004), equations 13 to 16, one window after the other."""
    offsets = np.arange(-5, 6)
    weights = np.exp(-(offsets[:, None] ** 2 + offsets**2) / (2 * 1.5**2))
    weights /= weights.sum()
    values = []
    for channel in range(3):
        a, b = first[..., channel].astype(float), second[..., channel].astype(float)
        for y in range(a.shape[0] - 10):
            for x in range(a.shape[1] - 10):
                p, q = a[y : y + 11, x : x + 11], b[y : y + 11, x : x + 11]
                mp, mq = (weights * p).sum(), (weights * q).sum()
                vp, vq = (weights * (p - mp) ** 2).sum(), (weights * (q - mq) ** 2).sum()
                cov = (weights * (p - mp) * (q - mq)).sum()
                c1, c2 = (0.01 * 255) ** 2, (0.03 * 255) ** 2
                top = (2 * mp * mq + c1) * (2 * cov + c2)
                values.append(top / ((mp**2 + mq**2 + c1) * (vp + vq + c2)))
    return float(np.mean(values))


def test_psnr_by_hand() -> None:
    black = np.zeros((4, 5, 3), np.uint8)
    assert psnr(black, black) == math.inf
    assert psnr(black + 255, black) == pytest.approx(0.0)
    one = black.copy()
    one[0, 0, 0] = 60  # mean squared error 3600 / 60 = 60
    assert psnr(one, black) == pytest.approx(10 * math.log10(65025 / 60))


def test_ssim_of_flat_images_is_the_luminance_term() -> None:
    first, second = (np.full((12, 13, 3), level, np.uint8) for level in (100, 150))
    c1 = 2.55**2
    assert ssim(first, second) == pytest.approx((2 * 15000 + c1) / (32500 + c1), abs=1e-9)


@pytest.mark.parametrize("seed", [0, 1])
def test_ssim_is_the_published_definition(seed: int) -> None:
    first = noise(seed)
    second = (first * 0.6 + noise(seed + 9) * 0.3).astype(np.uint8)
    assert ssim(first, second) == pytest.approx(ssim_by_definition(first, second), abs=1e-9)
    assert ssim(first, second) < 0.98


@given(st.integers(0, 1000), st.integers(0, 1000))
@settings(max_examples=20, deadline=None)
def test_ssim_and_psnr_are_symmetric_and_largest_where_equal(a: int, b: int) -> None:
    first, second = noise(a), noise(b)
    assert ssim(first, second) == pytest.approx(ssim(second, first), abs=1e-12)
    assert psnr(first, second) == psnr(second, first)
    assert ssim(first, first) == pytest.approx(1.0, abs=1e-12)
    assert -1 <= ssim(first, second) <= 1 + 1e-12


def test_small_images_have_no_ssim_and_unequal_ones_are_refused() -> None:
    assert math.isnan(ssim(noise(0, (10, 40)), noise(1, (10, 40))))
    with pytest.raises(ArrayContract, match="the reference has 18x16, not 17x16"):
        psnr(noise(0, (16, 17)), noise(1))
    with pytest.raises(ArrayContract, match="uint8 image"):
        ssim(noise(0).astype(float), noise(1))
