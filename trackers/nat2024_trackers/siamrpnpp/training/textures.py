"""Surfaces of objects and backgrounds: from photographs, or procedural."""

from collections.abc import Sequence
from typing import Any, TypeAlias

import cv2
import numpy as np
import numpy.typing as npt

from nat2024.types import Floats, Image
from nat2024_trackers.siamrpnpp.training.geometry import Rng, linear_map, placed
from nat2024_trackers.siamrpnpp.training.shapes import SIDE

Photographs: TypeAlias = Sequence[Image]
"""uint8 (H, W, 3) BGR each."""

Pixels: TypeAlias = npt.NDArray[np.float32]


def procedural_texture(rng: Rng) -> Image:
    """A base colour with a gradient, a few marks and coarse noise; uint8 (96, 96, 3)."""
    coloured = rng.random() < 0.6
    pixels = np.empty((SIDE, SIDE, 3), dtype=np.float32)
    pixels[:] = _colour(rng, coloured=coloured)
    if rng.random() < 0.5:
        ramp = np.linspace(-1, 1, SIDE, dtype=np.float32) * np.float32(rng.uniform(-60, 60))
        pixels += ramp[:, None, None] if rng.random() < 0.5 else ramp[None, :, None]
    for _ in range(int(rng.integers(1, 9))):
        _mark(rng, pixels, _colour(rng, coloured=coloured))
    if rng.random() < 0.5:
        pixels += coarse_noise(rng, SIDE, float(rng.uniform(4, 30)))
    _band(rng, pixels)
    return _to_image(pixels)


def photograph_texture(rng: Rng, photographs: Photographs) -> Image:
    """A region of a photograph, often recoloured; uint8 (96, 96, 3)."""
    photograph = photographs[int(rng.integers(len(photographs)))]
    height, width = photograph.shape[:2]
    side = float(rng.uniform(0.08, 0.5)) * min(height, width)
    aspect = float(np.exp(rng.uniform(-0.8, 0.8) / 2))
    w, h = min(side * aspect, width - 1), min(side / aspect, height - 1)
    x, y = rng.uniform(0, width - w), rng.uniform(0, height - h)
    region = photograph[int(y) : int(y + max(h, 2)), int(x) : int(x + max(w, 2))]
    pixels = np.asarray(
        cv2.resize(region, (SIDE, SIDE), interpolation=cv2.INTER_AREA), dtype=np.float32
    )
    if rng.random() < 0.3:
        pixels = np.ascontiguousarray(pixels[:, ::-1])
    if rng.random() < 0.5:
        channels = 3 if rng.random() < 0.5 else 1
        gain = rng.uniform(0.5, 1.5, size=channels).astype(np.float32)
        pixels = pixels * gain + rng.uniform(-40, 40, size=channels).astype(np.float32)
    _band(rng, pixels)
    return _to_image(pixels)


def recoloured(rng: Rng, texture: Image) -> Image:
    """The same surface in other colours, sometimes upside down."""
    gain = rng.uniform(0.4, 1.6, size=3).astype(np.float32)
    offset = rng.uniform(-50, 50, size=3).astype(np.float32)
    pixels = texture.astype(np.float32) * gain + offset
    return _to_image(pixels[::-1] if rng.random() < 0.3 else pixels)


def coarse_noise(rng: Rng, side: int, strength: float) -> Pixels:
    """Smooth noise float32 (side, side, 3) of about this standard deviation."""
    cells = int(rng.integers(3, max(4, side // 4)))
    noise = rng.standard_normal((cells, cells, 3), dtype=np.float32) * np.float32(strength)
    return np.asarray(cv2.resize(noise, (side, side), interpolation=cv2.INTER_LINEAR))


def plain_surface(rng: Rng, photographs: Photographs, side: int) -> Image:
    """A little of a photograph stretched over a whole background; uint8 (side, side, 3)."""
    photograph = photographs[int(rng.integers(len(photographs)))]
    height, width = photograph.shape[:2]
    part = max(6, int(rng.uniform(0.02, 0.12) * min(height, width)))
    x, y = int(rng.integers(width - part)), int(rng.integers(height - part))
    patch = cv2.resize(photograph[y : y + part, x : x + part], (side, side))
    if rng.random() < 0.5:
        patch = cv2.blur(cv2.blur(patch, (9, 9)), (9, 9))
    return _to_image(np.asarray(patch, dtype=np.float32) + coarse_noise(rng, side, 10))


def photograph_map(rng: Rng, photograph: Image, side: int) -> Floats:
    """A map from a photograph to a crop of `side`, so that its content covers most of the crop."""
    height, width = photograph.shape[:2]
    zoom = float(np.exp(rng.uniform(np.log(0.6), np.log(3.0))))
    linear = linear_map(width=zoom, height=zoom, angle=float(rng.uniform(-0.3, 0.3)))
    spot = rng.uniform(0.2, 0.8, size=2) * np.array([width, height])
    return placed(linear, spot, np.full(2, side / 2))


def _colour(rng: Rng, *, coloured: bool) -> Pixels:
    return rng.uniform(10, 245, size=3 if coloured else 1).astype(np.float32)


def _mark(rng: Rng, pixels: Pixels, colour: Pixels) -> None:
    values = [float(value) for value in np.broadcast_to(colour, 3)]
    (x0, y0), (x1, y1) = rng.integers(0, SIDE, size=(2, 2)).tolist()
    kind = int(rng.integers(4))
    if kind == 0:
        cv2.rectangle(pixels, (x0, y0), (x1, y1), values, -1)
    elif kind == 1:
        axes = rng.integers(4, 30, size=2).tolist()
        cv2.ellipse(pixels, (x0, y0), axes, float(rng.uniform(0, 180)), 0, 360, values, -1)
    elif kind == 2:
        cv2.line(pixels, (x0, y0), (x1, y1), values, int(rng.integers(1, 8)))
    else:
        thick = int(rng.integers(4, 20))
        cv2.rectangle(pixels, (0, y0), (SIDE, y0 + thick), values, -1)


def _band(rng: Rng, pixels: Pixels) -> None:
    if rng.random() < 0.25:
        top, thick = int(rng.integers(0, SIDE - 8)), int(rng.integers(8, 40))
        pixels[top : top + thick] = _colour(rng, coloured=rng.random() < 0.6)


def _to_image(pixels: npt.NDArray[np.floating[Any]]) -> Image:
    return np.asarray(np.clip(pixels, 0, 255), dtype=np.uint8)
