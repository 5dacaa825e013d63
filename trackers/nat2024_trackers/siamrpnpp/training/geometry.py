"""Affine maps and boxes of training pairs.

Coordinates are continuous: pixel i covers i to i + 1. A map is float64 (2, 3).
"""

import math
from typing import TypeAlias

import cv2
import numpy as np

from nat2024.types import Box, Floats, Image

EXEMPLAR = 127
"""Side of a template crop in pixels."""

Rng: TypeAlias = np.random.Generator


def standard_size(aspect: float) -> tuple[float, float]:
    """Width and height, of ratio `aspect`, of a target whose context fills a template crop."""
    pad = (aspect + 1) / 2
    height = EXEMPLAR / math.sqrt((aspect + pad) * (1 + pad))
    return aspect * height, height


def context_of(width: float, height: float) -> float:
    """Side of the square that holds a target and its context: the side of its template crop."""
    pad = (width + height) / 2
    return math.sqrt((width + pad) * (height + pad))


def linear_map(
    *, width: float = 1.0, height: float = 1.0, angle: float = 0.0, shear: float = 0.0
) -> Floats:
    """Stretch, then shear, then turn; float64 (2, 2)."""
    cosine, sine = math.cos(angle), math.sin(angle)
    turn = np.array([[cosine, -sine], [sine, cosine]])
    return np.asarray(turn @ np.array([[1.0, shear], [0.0, 1.0]]) @ np.diag([width, height]))


def placed(linear: Floats, source: Floats, target: Floats) -> Floats:
    """The affine map with this linear part that takes the point `source` to `target`."""
    return np.column_stack([linear, target - linear @ source])


def after(second: Floats, first: Floats) -> Floats:
    """The map that does `first`, then `second`."""
    linear = second[:, :2] @ first[:, :2]
    return np.column_stack([linear, second[:, :2] @ first[:, 2] + second[:, 2]])


def tight_box(outline: Floats, transform: Floats) -> Box:
    """Float64 (4,): x, y, w, h around the points (n, 2) after a map."""
    points = outline @ transform[:, :2].T + transform[:, 2]
    low, high = points.min(axis=0), points.max(axis=0)
    return np.concatenate([low, high - low])


def outline_of(mask: Image) -> Floats:
    """Corners of the first and last pixel of each row of a mask that are above half, (n, 2).

    Bounds of these points under any affine map are the bounds of the mask.
    """
    inside = mask > 127
    rows = np.flatnonzero(inside.any(axis=1))
    first = inside[rows].argmax(axis=1)
    last = mask.shape[1] - inside[rows, ::-1].argmax(axis=1)
    x = np.concatenate([first, first, last, last])
    y = np.concatenate([rows, rows + 1, rows, rows + 1])
    return np.column_stack([x, y]).astype(np.float64)


def warp(
    image: Image, transform: Floats, size: int, *, border: int = cv2.BORDER_REFLECT_101
) -> Image:
    """Draw an image under a map into a square of `size` pixels, bilinear."""
    linear = transform[:, :2]
    # OpenCV puts pixel centres, not pixel corners, at whole numbers.
    shift = transform[:, 2] + linear.sum(axis=1) / 2 - 0.5
    matrix = np.column_stack([linear, shift])
    drawn: Image = np.asarray(
        cv2.warpAffine(image, matrix, (size, size), flags=cv2.INTER_LINEAR, borderMode=border)
    )
    return drawn
