"""Masks of cut-out and procedural objects: uint8 (96, 96), 0 or 255, tight to their canvas."""

import math
from collections.abc import Callable

import cv2
import numpy as np

from nat2024.types import Image
from nat2024_trackers.siamrpnpp.training.geometry import Rng

SIDE = 96
_CANVAS = 160
_HALF = _CANVAS / 2


def draw_mask(rng: Rng) -> Image:
    """One of six kinds of shapes, half of them turned, half of them soft at the edge."""
    canvas = np.zeros((_CANVAS, _CANVAS), dtype=np.uint8)
    _SHAPES[int(rng.integers(len(_SHAPES)))](rng, canvas)
    if rng.random() < 0.5:
        angle = rng.choice([90, 180, 270]) if rng.random() < 0.5 else rng.uniform(0, 360)
        turn = cv2.getRotationMatrix2D((_HALF, _HALF), float(angle), 0.7)
        canvas = np.asarray(cv2.warpAffine(canvas, turn, (_CANVAS, _CANVAS)), dtype=np.uint8)
    left, top, width, height = cv2.boundingRect(np.asarray(canvas > 127, dtype=np.uint8))
    tight = canvas[top : top + height, left : left + width]
    mask = np.asarray(cv2.resize(tight, (SIDE, SIDE)), dtype=np.uint8)
    return np.where(mask > 127, 255, 0).astype(np.uint8)


def _point(rng: Rng, low: float, high: float) -> tuple[int, int]:
    x, y = rng.uniform(low, high, size=2) * _CANVAS
    return int(x), int(y)


def _ellipse(_rng: Rng, canvas: Image) -> None:
    cv2.ellipse(canvas, (int(_HALF), int(_HALF)), (60, 60), 0, 0, 360, 255, -1)


def _rectangle(rng: Rng, canvas: Image) -> None:
    radius = int(rng.uniform(2, 30))
    low, high = 20, _CANVAS - 20
    cv2.rectangle(canvas, (low + radius, low), (high - radius, high), 255, -1)
    cv2.rectangle(canvas, (low, low + radius), (high, high - radius), 255, -1)
    for x in (low + radius, high - radius):
        for y in (low + radius, high - radius):
            cv2.circle(canvas, (x, y), radius, 255, -1)


def _polygon(rng: Rng, canvas: Image) -> None:
    count = int(rng.integers(5, 13))
    angles = np.sort(rng.uniform(0, 2 * math.pi, size=count))
    radii = rng.uniform(0.45, 1.0, size=count) * 64
    points = np.column_stack([np.cos(angles), np.sin(angles)]) * radii[:, None] + _HALF
    cv2.fillPoly(canvas, [points.astype(np.int32)], 255)
    cv2.circle(canvas, (int(_HALF), int(_HALF)), 20, 255, -1)


def _union(rng: Rng, canvas: Image) -> None:
    for _ in range(int(rng.integers(2, 5))):
        axes = rng.uniform(14, 42, size=2).astype(int).tolist()
        angle = float(rng.uniform(0, 180))
        cv2.ellipse(canvas, _point(rng, 0.35, 0.65), axes, angle, 0, 360, 255, -1)


def _person(rng: Rng, canvas: Image) -> None:
    center, head = int(_HALF), int(rng.uniform(7, 12))
    shoulder, waist = 40, int(rng.uniform(75, 95))
    girth = int(rng.uniform(10, 20))
    cv2.circle(canvas, (center, shoulder - head), head, 255, -1)
    cv2.ellipse(
        canvas,
        (center, (shoulder + waist) // 2),
        (girth, (waist - shoulder) // 2 + 6),
        0, 0, 360, 255, -1,
    )  # fmt: skip
    thick = int(rng.uniform(6, 12))
    for side in (-1, 1):
        hand = (center + side * int(rng.uniform(10, 45)), int(rng.uniform(45, 95)))
        foot = (center + side * int(rng.uniform(2, 30)), int(rng.uniform(120, 150)))
        cv2.line(canvas, (center + side * girth // 2, shoulder + 6), hand, 255, max(4, thick - 3))
        cv2.line(canvas, (center + side * girth // 3, waist), foot, 255, thick)


def _vehicle(rng: Rng, canvas: Image) -> None:
    roof, floor = int(rng.uniform(60, 85)), 110
    cv2.rectangle(canvas, (15, roof), (_CANVAS - 15, floor), 255, -1)
    left, right = int(rng.uniform(20, 55)), int(rng.uniform(95, 140))
    top = roof - int(rng.uniform(15, 35))
    cabin = np.array([[left, roof], [left + 10, top], [right - 10, top], [right, roof]])
    cv2.fillPoly(canvas, [cabin.astype(np.int32)], 255)
    wheel = int(rng.uniform(9, 15))
    for x in (42, _CANVAS - 42):
        cv2.circle(canvas, (x, floor), wheel, 255, -1)


_SHAPES: tuple[Callable[[Rng, Image], None], ...] = (
    _ellipse,
    _rectangle,
    _polygon,
    _union,
    _person,
    _vehicle,
)
