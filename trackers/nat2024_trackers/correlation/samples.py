"""Cutting patches out of images at any place, size and scale, also beyond the border."""

from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from nat2024.types import Floats

Pixels: TypeAlias = npt.NDArray[np.uint8] | npt.NDArray[np.float32]
"""(H, W, 3), a frame or a patch of one, in 0..255."""


def cut(
    image: Pixels, center: tuple[float, float], extent: tuple[float, float], size: tuple[int, int]
) -> Pixels:
    """Resample a rectangle of an image; see `cut_all`. Gives (height, width, 3)."""
    patch: Pixels = cut_all(image, center, np.array([extent]), size)[0]
    return patch


def cut_all(
    image: Pixels, center: tuple[float, float], extents: Floats, size: tuple[int, int]
) -> Pixels:
    """Resample several rectangles around one place; beyond the border the edge is repeated.

    Bilinear between pixels; where the middle rectangle shrinks to half or less, areas are averaged
    first.

    Args:
        image: uint8 or float32 (H, W, 3); not modified, and never part of the result.
        center: x, y in image pixels (the first pixel covers 0..1).
        extents: (n, 2), width and height of each rectangle in image pixels.
        size: width and height of every result.

    Returns:
        (n, height, width, 3) of the image's type.
    """
    import cv2

    height, width = image.shape[:2]
    count = len(extents)
    left, x = _places(center[0], extents[:, 0], size[0], width)
    top, y = _places(center[1], extents[:, 1], size[1], height)
    part: Any = image[top : top + int(y.max()) + 2, left : left + int(x.max()) + 2]
    factors = [max(1, int(e / s)) for e, s in zip(extents[count // 2], size, strict=True)]
    small = [max(1, n // f) for n, f in zip(part.shape[1::-1], factors, strict=True)]
    if max(factors) > 1:
        x = (x + 0.5) * (small[0] / part.shape[1]) - 0.5
        y = (y + 0.5) * (small[1] / part.shape[0]) - 0.5
        part = cv2.resize(part, small, interpolation=cv2.INTER_AREA)
    columns = np.repeat(x.astype(np.float32), size[1], axis=0)
    rows = np.repeat(y.astype(np.float32).reshape(-1, 1), size[0], axis=1)
    patches: Any = cv2.remap(part, columns, rows, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    result: Pixels = patches.reshape(count, size[1], size[0], 3)
    return result


def _places(center: float, extents: Floats, size: int, limit: int) -> tuple[int, Floats]:
    """First pixel that is needed of an axis, and where the samples lie (n, size), from it on."""
    shares = (np.arange(size) + 0.5) / size - 0.5
    places = np.clip(center + np.outer(extents, shares) - 0.5, 0, limit - 1)
    first = int(places.min())
    return first, places - first
