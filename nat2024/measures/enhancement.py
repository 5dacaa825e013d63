"""What an enhancer did to one image: light, over-enhancement, noise, contrast, unevenness.

Grey is the mean of the three channels in 0..1, as in all measures here, so the channel order does
not matter as long as it is the same before, after and in the reference. Shares, luminance,
over-enhancement and noise are taken at the image's own size; local contrast and unevenness at
256x256, as in `night_statistics` and `light_spread`, so that they compare between cameras.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields
from types import MappingProxyType

import numpy as np

from nat2024.measures.fidelity import check_pair, psnr, ssim
from nat2024.measures.light import light_spread
from nat2024.measures.night import (
    BRIGHT_LEVEL,
    DARK_LEVEL,
    NOISE_BLOCK,
    SATURATION_LEVEL,
    night_statistics,
)
from nat2024.measures.pixels import block_statistics, blocks, grey
from nat2024.types import Flags, Floats, Image

ONE_LEVEL = 1 / 255
"""A rise must be above this to count: 8-bit rounding alone moves a grey level by less."""

FLAT_SPREAD = 8 / 255
"""A block whose grey levels spread more than this is texture, however flat among its like."""

FLAT_RANGE = (2 / 255, SATURATION_LEVEL)
"""Mean grey level of blocks where noise can be seen: noise is cut off at black and at white."""

LEAST_FLAT_BLOCKS = 4
LEAST_NOISE = 0.1 / 255
"""Noise below this is rounding; how it grows tells nothing."""

ENHANCEMENT_MEASURES = MappingProxyType(
    {
        "mean_before": "mean grey level before",
        "mean_after": "mean grey level after",
        "spread_before": "standard deviation of the grey levels before",
        "spread_after": "standard deviation of the grey levels after",
        "saturated_before": "share of pixels whose largest channel is above 0.97, before",
        "saturated_after": "the same after",
        "dark_before": "share of pixels with a grey level below 0.15, before",
        "dark_after": "the same after",
        "bright_before": "share of pixels with a grey level above 0.7, before",
        "over_enhanced": "share of the pixels bright before that got brighter by over 1/255",
        "over_enhanced_rise": "mean rise of these pixels",
        "noise_gain": "noise after / noise before, in blocks that were flat before",
        "relative_noise_gain": "noise_gain / (mean grey level after / before) in these blocks",
        "local_contrast_before": "standard deviation in a 16x16 block, mean over blocks, before",
        "local_contrast_after": "the same after",
        "relative_contrast_before": "standard deviation / (mean + 0.01) of a block, median, before",
        "relative_contrast_after": "the same after",
        "unevenness_before": "spread of light over the image in stops, before",
        "unevenness_after": "the same after",
        "psnr": "peak signal-to-noise ratio to the reference, dB",
        "ssim": "structural similarity to the reference",
    }
)
"""What each entry of `EnhancementMeasures` is; NaN where it is not defined."""


@dataclass(frozen=True, slots=True)
class EnhancementMeasures:
    """What an enhancer did to one image; `ENHANCEMENT_MEASURES` explains each number.

    Shares and levels are in 0..1, gains are factors, unevenness is in stops. NaN: `over_enhanced`
    and its rise where no pixel was bright; the noise gains where there is no flat region with
    noise in it; `psnr` and `ssim` without a reference, `ssim` also where no 11x11 window fits.
    """

    mean_before: float
    mean_after: float
    spread_before: float
    spread_after: float
    saturated_before: float
    saturated_after: float
    dark_before: float
    dark_after: float
    bright_before: float
    over_enhanced: float
    over_enhanced_rise: float
    noise_gain: float
    relative_noise_gain: float
    local_contrast_before: float
    local_contrast_after: float
    relative_contrast_before: float
    relative_contrast_after: float
    unevenness_before: float
    unevenness_after: float
    psnr: float
    ssim: float

    def as_row(self) -> dict[str, float]:
        """The numbers by their names, in the order above."""
        return {field.name: getattr(self, field.name) for field in fields(self)}


def measure_enhancement(
    before: Image, after: Image, reference: Image | None = None
) -> EnhancementMeasures:
    """Measure what was done to one image.

    Args:
        before: uint8 (H, W, 3) in any channel order.
        after: the enhanced image, of the same size and channel order.
        reference: how it should look, such as the same view by day, likewise; for PSNR and SSIM.

    Raises:
        ArrayContract: one is no uint8 image of shape (H, W, 3), or sizes differ.
    """
    check_pair(before, after, "enhanced image")
    levels, new_levels = grey(before), grey(after)
    over, rise = _over_enhancement(levels, new_levels)
    noise, relative_noise = _noise_gains(levels, new_levels)
    old, new = night_statistics(before), night_statistics(after)
    return EnhancementMeasures(
        mean_before=float(levels.mean()),
        mean_after=float(new_levels.mean()),
        spread_before=float(levels.std()),
        spread_after=float(new_levels.std()),
        saturated_before=_saturated(before),
        saturated_after=_saturated(after),
        dark_before=float(np.mean(levels < DARK_LEVEL)),
        dark_after=float(np.mean(new_levels < DARK_LEVEL)),
        bright_before=float(np.mean(levels > BRIGHT_LEVEL)),
        over_enhanced=over,
        over_enhanced_rise=rise,
        noise_gain=noise,
        relative_noise_gain=relative_noise,
        local_contrast_before=old["local_contrast"],
        local_contrast_after=new["local_contrast"],
        relative_contrast_before=old["relative_contrast"],
        relative_contrast_after=new["relative_contrast"],
        unevenness_before=light_spread(before),
        unevenness_after=light_spread(after),
        psnr=psnr(after, reference) if reference is not None else float("nan"),
        ssim=ssim(after, reference) if reference is not None else float("nan"),
    )


def mean_measures(rows: Iterable[Mapping[str, float]]) -> dict[str, float]:
    """Mean of each entry over rows that define it (not NaN); NaN where none does.

    Infinite values, PSNR of equal images, make an infinite mean.
    """
    columns: dict[str, list[float]] = {}
    for row in rows:
        for name, value in row.items():
            columns.setdefault(name, []).append(value)
    means = {}
    for name, values in columns.items():
        defined = [value for value in values if not np.isnan(value)]
        means[name] = float(np.mean(defined)) if defined else float("nan")
    return means


def _saturated(image: Image) -> float:
    return float(np.mean(image.max(axis=2) > SATURATION_LEVEL * 255))


def _over_enhancement(before: Floats, after: Floats) -> tuple[float, float]:
    bright = before > BRIGHT_LEVEL
    if not bright.any():
        return float("nan"), float("nan")
    rise = (after - before)[bright]
    # a hair above one level, for a rise of exactly one level is not exact in floats
    risen = rise > ONE_LEVEL * 1.001
    return float(risen.mean()), float(rise[risen].mean()) if risen.any() else 0.0


def _noise_gains(before: Floats, after: Floats) -> tuple[float, float]:
    flat = flat_blocks(before)
    if flat.sum() < LEAST_FLAT_BLOCKS:
        return float("nan"), float("nan")
    noise = _noise(before, flat)
    if noise < LEAST_NOISE:
        return float("nan"), float("nan")
    gain = _noise(after, flat) / noise
    old, new = (block_statistics(levels, NOISE_BLOCK)[0][flat].mean() for levels in (before, after))
    return float(gain), float(gain * old / new) if new > 0 else float("nan")


def _noise(levels: Floats, chosen: Flags) -> float:
    """Standard deviation of the noise in chosen 8x8 blocks, by Immerkaer's method.

    Taken inside each block only, so that an edge beside a block does not count (`noise_sigma`,
    which compares images of one size, does not need that).
    """
    found = blocks(levels, NOISE_BLOCK)[chosen]
    rows = found[:, :-2] - 2 * found[:, 1:-1] + found[:, 2:]
    laplacians = rows[..., :-2] - 2 * rows[..., 1:-1] + rows[..., 2:]
    return float(laplacians.std() / 6)


def flat_blocks(levels: Floats) -> Flags:
    """Which 8x8 blocks of grey levels, float64 (H, W) in 0..1, are flat but not without noise.

    Among the blocks that are neither constant (cut off, or smoothed by compression) nor nearly
    black or white on average, the quarter that spreads least, and of these none whose standard
    deviation is above 8/255. Empty for images below 8x8.
    """
    if min(levels.shape) < NOISE_BLOCK:
        return np.zeros((0, 0), dtype=np.bool_)
    means, spread = block_statistics(levels, NOISE_BLOCK)
    useful = (spread > 1e-9) & (means > FLAT_RANGE[0]) & (means < FLAT_RANGE[1])
    if not useful.any():
        return useful
    limit = min(float(np.quantile(spread[useful], 0.25)), FLAT_SPREAD)
    flat: Flags = useful & (spread <= limit)
    return flat
