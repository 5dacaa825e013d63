"""Grey levels, area resizing and statistics of square blocks: what the measures are made of."""

from typing import Any

import numpy as np
import numpy.typing as npt

from nat2024.errors import ArrayContract
from nat2024.types import Floats, Image


def check_image(image: Any) -> Image:
    """Return `image` if it is uint8 (H, W, 3) and not empty, else raise `ArrayContract`."""
    if (
        not isinstance(image, np.ndarray)
        or image.dtype != np.uint8
        or image.ndim != 3
        or image.shape[2] != 3
        or not image.size
    ):
        kind = f"{getattr(image, 'dtype', type(image).__name__)} {getattr(image, 'shape', '')}"
        msg = f"a measure needs a uint8 image of shape (H, W, 3), not {kind.strip()}"
        raise ArrayContract(msg)
    return image


def resize_area(image: Image, size: tuple[int, int]) -> Image:
    """Resize to `size` (width, height) by pixel areas, uint8; the aspect ratio is not kept."""
    if (image.shape[1], image.shape[0]) == size:
        return image
    import cv2

    resized = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    return np.ascontiguousarray(resized, dtype=np.uint8)


def grey(image: Image) -> Floats:
    """Mean of the three channels, float64 (H, W) in 0..1; the channel order does not matter."""
    total = image[..., 0].astype(np.float64)  # several times as fast as a sum over the last axis
    total += image[..., 1]
    total += image[..., 2]
    total /= 3 * 255.0
    return total


def blocks(values: npt.NDArray[Any], side: int) -> npt.NDArray[Any]:
    """The square blocks of `values` (H, W) as (H // side, W // side, side, side).

    What remains right and below of whole blocks is left out.

    Raises:
        ArrayContract: not even one block fits.
    """
    rows, columns = values.shape[0] // side, values.shape[1] // side
    if not rows or not columns:
        msg = f"no block of {side}x{side} fits into {values.shape[1]}x{values.shape[0]} pixels"
        raise ArrayContract(msg)
    whole = values[: rows * side, : columns * side]
    return whole.reshape(rows, side, columns, side).swapaxes(1, 2)


def block_statistics(values: Floats, side: int) -> tuple[Floats, Floats]:
    """Mean and standard deviation of `blocks`, two arrays float64 (H // side, W // side)."""
    found = blocks(values, side)
    return found.mean(axis=(2, 3)), found.std(axis=(2, 3))
