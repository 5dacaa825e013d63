"""Uneven light: how much the light falling on the parts of an image differs.

A dark pixel may be a dark surface or an unlit one. The brightest surface of a small cell tells
the light that falls on the cell better than its mean does, as in white-patch colour constancy.
The spread of that light over the cells, in stops (factors of two), is the measure of uneven
light: pools of lamp light beside unlit ground give a large one, dim light all over a small one.
"""

import numpy as np

from nat2024.measures.night import DARK_LEVEL, LIGHT_BLOCK, MEASURE_SIZE, SATURATION_LEVEL
from nat2024.measures.pixels import blocks, check_image, grey, resize_area
from nat2024.types import Box, Floats, Image

LIGHT_FLOOR = 0.04
"""Added to the light of a cell before its logarithm: about 10 of 255 grey levels, under which
black level and noise hide what light there is."""

UNEVEN_LIGHT_STOPS = 0.88
"""Images with a spread of light from here on count as unevenly lit. The best balanced accuracy
on 75 night images that were labelled by eye, 52 lit by lamps and 23 evenly dark: 0.91; area under
the ROC curve 0.92. Floors of 0.02 to 0.08 and percentiles of 90 to 100 give areas of 0.89 to
0.93."""

TARGET_CONTEXT = 4.0
"""Side of the region around a target over the square root of the target's area."""

_BRIGHT_PERCENTILE = 99
_REGION_SIZE = (128, 128)


def cell_light(image: Image, size: tuple[int, int] = MEASURE_SIZE) -> Floats:
    """Light that falls on each 16x16 cell of an image resized to `size` (width, height).

    Args:
        image: uint8 (H, W, 3) BGR.
        size: at least 16 each.

    Returns:
        float64 (height // 16, width // 16) in 0..1: the 99th percentile of the grey levels.

    Raises:
        ArrayContract: the image is none, or the size holds no cell.
    """
    levels = grey(resize_area(check_image(image), size))
    cells = blocks(levels, LIGHT_BLOCK)
    bright: Floats = np.percentile(cells, _BRIGHT_PERCENTILE, axis=(2, 3))
    return bright


def light_spread(image: Image) -> float:
    """Spread of light over the image in stops; from `UNEVEN_LIGHT_STOPS` on it is uneven.

    The standard deviation over cells of the binary logarithm of `cell_light`.

    Raises:
        ArrayContract: the image is none.
    """
    return _spread(cell_light(image))


def target_light_spread(image: Image, box: Box, context: float = TARGET_CONTEXT) -> float:
    """Spread of light around a target in stops, over 8x8 cells of a square region.

    Args:
        image: uint8 (H, W, 3) BGR.
        box: x, y, w, h of the target.
        context: side of the region over the square root of the box's area.

    Returns:
        NaN where no part of the region lies in the image, or the box is absent or has no area.

    Raises:
        ArrayContract: the image is none.
    """
    side = context * np.sqrt(box[2] * box[3]) if (box[2:] > 0).all() else np.nan
    region = crop_around(check_image(image), box, (side, side))
    return _spread(cell_light(region, _REGION_SIZE)) if region is not None else float("nan")


def saturated_beside_dark(image: Image) -> float:
    """Share of cells with a saturated pixel that are dark on average or touch such a cell.

    Saturated is a largest channel above 0.97, dark a mean grey level below 0.15; the image is
    resized to 256x256 and cells are of 16x16 pixels. The companion of `light_spread`: lamps in
    view, beside ground that they leave dark.

    Raises:
        ArrayContract: the image is none.
    """
    pixels = resize_area(check_image(image), MEASURE_SIZE)
    largest = np.maximum(np.maximum(pixels[..., 0], pixels[..., 1]), pixels[..., 2])
    peaks = blocks(largest, LIGHT_BLOCK).max(axis=(2, 3))
    dark = blocks(grey(pixels), LIGHT_BLOCK).mean(axis=(2, 3)) < DARK_LEVEL
    padded = np.pad(dark, 1)
    rows, columns = dark.shape
    near = np.any(
        [padded[y : y + rows, x : x + columns] for y in range(3) for x in range(3)], axis=0
    )
    return float(np.mean((peaks > SATURATION_LEVEL * 255) & near))


def crop_around(image: Image, box: Box, size: tuple[float, float]) -> Image | None:
    """The part of the image in a region of `size` (width, height) centred on a box.

    Returns:
        A view of the image with whole pixels; None where nothing is left of it, or a number is
        not finite.
    """
    centre = box[:2] + box[2:] / 2
    half = np.array(size) / 2
    low, high = centre - half, centre + half
    if not (np.isfinite(low).all() and np.isfinite(high).all()):
        return None
    limits = np.array([image.shape[1], image.shape[0]])
    left, top = np.clip(np.floor(low), 0, limits).astype(int)
    right, bottom = np.clip(np.ceil(high), 0, limits).astype(int)
    region = image[top:bottom, left:right]
    return region if region.size else None


def local_grey(image: Image, box: Box, context: float = 1.0) -> float:
    """Mean grey level, 0..255, of a box whose sides are enlarged `context` times.

    NaN where no part of it lies in the image, or the box is absent.
    """
    region = crop_around(check_image(image), box, (context * box[2], context * box[3]))
    return float(region.mean(dtype=np.float64)) if region is not None else float("nan")


def _spread(light: Floats) -> float:
    return float(np.log2(light + LIGHT_FLOOR).std())
