"""A short plain night clip: one vehicle on a dark ground between street lamps, seen from above.

Rendered in linear light (albedo times light, plus the glow of the lamps), then exposed with shot
and read noise and written with the sRGB-like response 1/2.2. Everything follows from the seed.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from nat2024.types import Box, Floats, Image

_AMBIENT = 0.012
"""Light away from any lamp, where 1 is a white surface at the sensor's limit."""

_LAMP = np.array([0.35, 0.72, 1.0])
"""Sodium street light, BGR."""


@dataclass(frozen=True, slots=True)
class Clip:
    """Settings of one clip.

    Attributes:
        name: its sequence name.
        frames: number of frames.
        size: (width, height) in pixels.
        target_size: (width, height) of the vehicle in pixels.
        lamps: number of street lamps.
        seed: what all randomness follows from.
    """

    name: str
    frames: int = 60
    size: tuple[int, int] = (320, 180)
    target_size: tuple[int, int] = (34, 20)
    lamps: int = 3
    seed: int = 0


def render_clip(clip: Clip) -> Iterator[tuple[Image, Box]]:
    """Render a clip frame by frame.

    Yields:
        uint8 (H, W, 3) BGR and the float64 (4,) box of the vehicle, exact to the sub-pixel.
    """
    rng = np.random.default_rng(clip.seed)
    width, height = clip.size
    reach = 40  # how far the camera wanders over the ground, in pixels
    ground = _ground(rng, width + 2 * reach, height + 2 * reach)
    lamps = rng.uniform((0, 0), (width + 2 * reach, height + 2 * reach), size=(clip.lamps, 2))
    sprite = _vehicle(rng, clip.target_size)
    start, end = _route(rng, clip)
    sway = rng.uniform(0, 2 * np.pi, size=4)
    for index in range(clip.frames):
        progress = index / max(clip.frames - 1, 1)
        camera = reach + reach * 0.4 * np.sin(2 * np.pi * progress * np.array([1, 1.3]) + sway[:2])
        wobble = 3 * np.sin(2 * np.pi * 2 * progress + sway[2:])
        corner = start + (end - start) * progress + wobble
        scene = _cut(ground, camera, clip.size)
        scene = _place(scene, sprite, corner)
        exposed = scene * _light(lamps - camera, clip.size) + _glow(lamps - camera, clip.size)
        box = np.array([*corner, *clip.target_size], dtype=np.float64)
        yield _expose(rng, exposed), box


def _ground(rng: np.random.Generator, width: int, height: int) -> Floats:
    """Albedo of asphalt and grass: noise on several scales, and a few painted lines."""
    import cv2

    albedo = np.full((height, width), 0.25)
    for scale, strength in ((48, 0.10), (12, 0.06), (3, 0.05)):
        coarse = rng.standard_normal((height // scale + 2, width // scale + 2))
        fine = cv2.resize(coarse, (width, height), interpolation=cv2.INTER_CUBIC)
        albedo += strength * np.asarray(fine, dtype=np.float64)
    for y in rng.uniform(0, height, size=3).astype(int):
        cv2.line(albedo, (0, int(y)), (width, int(y) + 25), 0.6, 2)
    tinted: Floats = np.clip(albedo, 0.03, 0.9)[..., None] * np.array([0.9, 1.0, 1.0])
    return tinted


def _vehicle(rng: np.random.Generator, size: tuple[int, int]) -> Floats:
    """Albedo of a vehicle from above: body, windscreens, bright lights at its front."""
    width, height = size
    body = np.empty((height, width, 3))
    body[:] = rng.uniform(0.45, 0.9, size=3)
    body[:, int(width * 0.62) : int(width * 0.75)] = 0.05
    body[:, int(width * 0.12) : int(width * 0.2)] = 0.08
    body[: height // 6] *= 0.5
    body[-(height // 6) :] *= 0.5
    return body


def _route(rng: np.random.Generator, clip: Clip) -> tuple[Floats, Floats]:
    """Start and end of the vehicle's top-left corner, inside the frame with a margin."""
    width, height = clip.size
    target_width, target_height = clip.target_size
    room = np.array([width - target_width - 24, height - target_height - 24], dtype=np.float64)
    start: Floats = 12 + room * np.array([0.05, rng.uniform(0.2, 0.8)])
    end = 12 + room * np.array([0.85, rng.uniform(0.2, 0.8)])
    return start, end


def _cut(ground: Floats, corner: Floats, size: tuple[int, int]) -> Floats:
    """The part of the ground that the camera sees, at a sub-pixel position."""
    import cv2

    shift = np.array([[1, 0, -corner[0]], [0, 1, -corner[1]]])
    return np.asarray(cv2.warpAffine(ground, shift, size), dtype=np.float64)


def _place(scene: Floats, sprite: Floats, corner: Floats) -> Floats:
    """Lay the vehicle over the scene at a sub-pixel position, with a soft shadow beside it."""
    import cv2

    height, width = scene.shape[:2]
    shift = np.array([[1, 0, corner[0]], [0, 1, corner[1]]])
    mask = cv2.warpAffine(np.ones(sprite.shape[:2]), shift, (width, height))[..., None]
    body = cv2.warpAffine(sprite, shift, (width, height))
    shadow = cv2.GaussianBlur(np.roll(mask[..., 0], (3, 2), axis=(0, 1)), (0, 0), 2)[..., None]
    return np.asarray(scene * (1 - 0.6 * shadow) * (1 - mask) + body, dtype=np.float64)


def _light(lamps: Floats, size: tuple[int, int]) -> Floats:
    """Light on the ground: ambient, and the inverse-square fall-off of lamps above it."""
    light = np.full((size[1], size[0], 3), _AMBIENT)
    for squared in _squared_distances(lamps, size):
        light += 0.5 * _LAMP / (1 + squared[..., None] / 35.0**2) ** 1.5
    return light


def _glow(lamps: Floats, size: tuple[int, int]) -> Floats:
    """Light that reaches the lens from the lamps themselves."""
    glow = np.zeros((size[1], size[0], 3))
    for squared in _squared_distances(lamps, size):
        glow += 1.2 * _LAMP * np.exp(-squared / 18.0)[..., None]
    return glow


def _squared_distances(lamps: Floats, size: tuple[int, int]) -> Iterator[Floats]:
    x, y = np.arange(size[0]), np.arange(size[1])[:, None]
    for lamp_x, lamp_y in lamps:
        yield (x - lamp_x) ** 2 + (y - lamp_y) ** 2


def _expose(rng: np.random.Generator, light: Floats) -> Image:
    """What the sensor writes: shot noise grows with the light, read noise does not."""
    noise = rng.standard_normal(light.shape)
    exposed = light + noise * np.sqrt(0.0004 * light + 0.004**2)
    pixels = 255.0 * np.clip(exposed, 0, 1) ** (1 / 2.2)
    return np.rint(pixels).astype(np.uint8)
