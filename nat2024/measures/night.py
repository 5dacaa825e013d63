"""Statistics by which night footage is told from other footage, and rendered from real.

They are taken at one size, so that they compare between cameras: noise, gradients and steps
depend on it. The small constants that are added to denominators keep black blocks from
counting as infinitely contrasty; they are one to three grey levels of 255.
"""

from types import MappingProxyType

import numpy as np

from nat2024.errors import ArrayContract
from nat2024.measures.pixels import block_statistics, check_image, grey, resize_area
from nat2024.types import Floats, Image

MEASURE_SIZE = (256, 256)
"""(width, height) at which `night_statistics` are taken; comparable numbers need the same."""

DARK_LEVEL = 0.15
BRIGHT_LEVEL = 0.7
SATURATION_LEVEL = 0.97
STEP_LEVEL = 0.05
LIGHT_BLOCK = 16
NOISE_BLOCK = 8

_BLOCK_FLOOR = 0.01
_MEAN_FLOOR = 0.001

NIGHT_MEASURES = MappingProxyType(
    {
        "mean": "mean grey level",
        "p5": "5th percentile of the grey levels",
        "p25": "25th percentile of the grey levels",
        "p50": "median grey level",
        "p95": "95th percentile of the grey levels",
        "p99": "99th percentile of the grey levels",
        "p99_9": "99.9th percentile of the grey levels",
        "dark_share": "share of pixels with a grey level below 0.15",
        "bright_share": "share of pixels with a grey level above 0.7",
        "saturated_share": "share of pixels whose largest channel is above 0.97",
        "local_contrast": "standard deviation within a block, mean over blocks",
        "relative_contrast": "standard deviation / (mean + 0.01) of a block, median over blocks",
        "unevenness": "standard deviation of the block means / (mean + 0.001)",
        "block_ratio": "95th percentile of the block means / (their median + 0.01)",
        "noise_sigma": "standard deviation of noise, from the flattest quarter of 8x8 blocks",
        "red_green": "mean of the red channel / mean of the green channel",
        "blue_green": "mean of the blue channel / mean of the green channel",
        "mean_gradient": "mean difference between horizontal neighbours",
        "step_share": "share of horizontal neighbours that differ by more than 0.05",
    }
)
"""What each entry of `night_statistics` is. Blocks are 16x16 pixels unless another size is
named; grey is the mean of the channels, 0..1."""


def night_statistics(image: Image, size: tuple[int, int] = MEASURE_SIZE) -> dict[str, float]:
    """Statistics of one image, named and explained in `NIGHT_MEASURES`.

    Args:
        image: uint8 (H, W, 3) BGR.
        size: (width, height), at least 16 each, to which it is resized by pixel areas first.

    Raises:
        ArrayContract: the image or the size is none.
    """
    if min(size) < LIGHT_BLOCK:
        msg = f"night statistics need a size of at least {LIGHT_BLOCK}x{LIGHT_BLOCK}, not {size}"
        raise ArrayContract(msg)
    pixels = resize_area(check_image(image), size)
    levels = grey(pixels)
    p5, p25, p50, p95, p99, p99_9 = np.percentile(levels, (5, 25, 50, 95, 99, 99.9))
    step = np.abs(np.diff(levels, axis=1))
    blue, green, red = pixels.reshape(-1, 3).mean(axis=0) / 255
    statistics = {
        "mean": levels.mean(),
        "p5": p5,
        "p25": p25,
        "p50": p50,
        "p95": p95,
        "p99": p99,
        "p99_9": p99_9,
        "dark_share": np.mean(levels < DARK_LEVEL),
        "bright_share": np.mean(levels > BRIGHT_LEVEL),
        "saturated_share": np.mean(pixels.max(axis=2) > SATURATION_LEVEL * 255),
        **_block_measures(levels),
        "noise_sigma": noise_sigma(levels),
        "red_green": red / max(green, _MEAN_FLOOR),
        "blue_green": blue / max(green, _MEAN_FLOOR),
        "mean_gradient": step.mean(),
        "step_share": np.mean(step > STEP_LEVEL),
    }
    return {name: float(value) for name, value in statistics.items()}


def _block_measures(levels: Floats) -> dict[str, float]:
    means, deviations = block_statistics(levels, LIGHT_BLOCK)
    high, middle = np.percentile(means, (95, 50))
    return {
        "local_contrast": float(deviations.mean()),
        "relative_contrast": float(np.median(deviations / (means + _BLOCK_FLOOR))),
        "unevenness": float(means.std() / (means.mean() + _MEAN_FLOOR)),
        "block_ratio": float(high / (middle + _BLOCK_FLOOR)),
    }


def noise_sigma(levels: Floats) -> float:
    """Standard deviation of the noise of `levels`, float64 (H, W), at least 8x8.

    The difference of two Laplacians leaves noise and cancels edges and ramps (Immerkaer, "Fast
    Noise Variance Estimation", CVIU 1996); it is taken over the quarter of the 8x8 blocks that
    varies least, so that texture does not count as noise.
    """
    padded = np.pad(levels, 1, mode="reflect")
    rows = padded[:-2] - 2 * padded[1:-1] + padded[2:]
    laplacians = rows[:, :-2] - 2 * rows[:, 1:-1] + rows[:, 2:]
    _, spread = block_statistics(levels, NOISE_BLOCK)
    means, deviations = block_statistics(laplacians, NOISE_BLOCK)
    flat = spread <= np.quantile(spread, 0.25)
    variance = np.mean(deviations[flat] ** 2 + means[flat] ** 2) - means[flat].mean() ** 2
    return float(np.sqrt(max(variance, 0.0)) / 6)
