"""Lamps over the ground: where they stand, the light that they cast, and what stands in it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from nat2024.night.arrays import Colour, Light, Points, colour, log_uniform
from nat2024.night.ground import Plan

CELLS = 384
"""Width of a light map in cells: light varies more slowly than albedo."""


@dataclass(frozen=True, slots=True)
class Lamp:
    """A lamp on a post.

    Attributes:
        position: x, y, z of its head in metres.
        strength: irradiance of the ground below it.
        tint: colour of its light, mean 1, BGR.
        spread: tangent of the half angle of its cone.
        edge: width of the cone's soft edge, as a share of its radius.
        glare: radiance of the head as the camera sees it, in units of the light below it.
    """

    position: tuple[float, float, float]
    strength: float
    tint: Colour
    spread: float
    edge: float
    glare: float


def lamp_colour(rng: np.random.Generator) -> Colour:
    """LED, sodium or cold white light, mean 1, BGR."""
    kind = rng.random()
    if kind < 0.42:
        red, green, blue = 1.0, rng.uniform(0.85, 1), rng.uniform(0.55, 0.92)
    elif kind < 0.76:
        red, green, blue = 1.0, rng.uniform(0.55, 0.75), rng.uniform(0.14, 0.4)
    elif kind < 0.96:
        red, green, blue = rng.uniform(0.75, 0.95), rng.uniform(0.9, 1), 1.0
    else:
        red, green, blue = rng.uniform(0.3, 1, size=3)
    tint = colour(blue, green, red)
    return np.asarray(tint / tint.mean(), dtype=np.float32)


def place_lamps(rng: np.random.Generator, plan: Plan) -> tuple[Lamp, ...]:
    """Street lamps along the roads and the bank, posts on the square; some are out."""
    common = lamp_colour(rng)
    spots: list[tuple[float, float, float]] = []
    height = float(rng.uniform(7, 11))
    pitch = float(rng.uniform(24, 42))
    for road in plan.roads:
        for number, along in enumerate(np.arange(-plan.side / 2 + 6, plan.side / 2, pitch)):
            across = (road.half + 0.2) * (1 if number % 2 else -1) + road.centre
            x, y = (across, along) if road.along_y else (along, across)
            spots.append((float(x), float(y), height))
    if plan.square is not None:
        spots += _on_square(rng, plan.square)
    if plan.bank is not None:
        step = float(rng.uniform(9, 18))
        spots += [(plan.bank - 1.0, float(y), 4.5) for y in np.arange(-plan.side / 2, 99, step)]
    for _ in range(int(rng.integers(4, 10))):  # in yards and gardens
        x, y = rng.uniform(-0.48, 0.48, size=2) * plan.side
        spots.append((float(x), float(y), float(rng.uniform(2.5, 6))))
    lit = [spot for spot in spots if rng.random() < 0.85]
    return tuple(_lamp(rng, spot, common) for spot in lit)


def _on_square(
    rng: np.random.Generator, square: tuple[float, float, float, float]
) -> list[tuple[float, float, float]]:
    x0, y0, x1, y1 = square
    step = float(rng.uniform(13, 22))
    height = float(rng.uniform(4, 8))
    grid = [(x, y) for x in np.arange(x0, x1 + 1, step) for y in np.arange(y0, y1 + 1, step)]
    kept = [spot for spot in grid if rng.random() < 0.6]
    return [(float(x), float(y), height) for x, y in kept]


def _lamp(rng: np.random.Generator, spot: tuple[float, float, float], common: Colour) -> Lamp:
    tint = common if rng.random() < 0.7 else lamp_colour(rng)
    return Lamp(
        spot,
        strength=log_uniform(rng, 0.5, 2.4),
        tint=tint,
        spread=float(rng.uniform(1.0, 2.2)),
        edge=float(rng.uniform(0.1, 0.5)),
        glare=log_uniform(rng, 8, 40),
    )


def ambient_light(rng: np.random.Generator) -> Colour:
    """Sky and scattered light, in units of the light under a lamp, BGR."""
    level = log_uniform(rng, 0.005, 0.03)
    tint = colour(float(rng.uniform(0.85, 1.25)), 1.0, float(rng.uniform(0.8, 1.1)))
    return np.asarray(level * tint, dtype=np.float32)


def light_map(
    plan: Plan, lamps: Sequence[Lamp], ambient: Colour, footprints: Sequence[Points]
) -> Light:
    """Irradiance of the ground, float32 (CELLS, CELLS, 3), in the frame of the plan.

    Each lamp's light falls off with the inverse square of the distance and the cosine at which it
    arrives, ends at the edge of its shade, and is kept out by what stands on the footprints.
    """
    light = np.empty((CELLS, CELLS, 3), dtype=np.float32)
    light[:] = ambient
    cell = plan.side / CELLS
    centres = ((np.arange(CELLS) + 0.5) * cell - plan.side / 2).astype(np.float32)
    for lamp in lamps:
        x, y, height = lamp.position
        reach = 6 * height
        columns = slice(*np.searchsorted(centres, (x - reach, x + reach)))
        rows = slice(*np.searchsorted(centres, (y - reach, y + reach)))
        if columns.start == columns.stop or rows.start == rows.stop:
            continue
        across, down = centres[columns] - np.float32(x), centres[rows] - np.float32(y)
        squared = across**2 + (down**2)[:, None]
        pool = _pool(lamp, squared)
        pool *= _free(lamp, footprints, columns, rows, pool.shape, plan)
        light[rows, columns] += pool[..., None] * lamp.tint
    return light


def _pool(lamp: Lamp, squared: Light) -> Light:
    height = lamp.position[2]
    falloff = (1 + squared / np.float32(height**2)) ** np.float32(-1.5)
    radius = lamp.spread * height
    edge = (radius - np.sqrt(squared)) / (0.25 * lamp.edge * radius + 0.05)
    cone = 1 / (1 + np.exp(-np.clip(edge, -30, 30)))
    scattered = np.float32(0.06)
    return np.asarray(lamp.strength * falloff * (cone + scattered), dtype=np.float32)


def _free(
    lamp: Lamp,
    footprints: Sequence[Points],
    columns: slice,
    rows: slice,
    shape: tuple[int, ...],
    plan: Plan,
) -> Light:
    """0 where something stands between the lamp and the ground, else 1."""
    import cv2

    mask = np.ones(shape, dtype=np.float32)
    cell = plan.side / CELLS
    source = np.array(lamp.position[:2])
    reach = 6 * lamp.position[2]
    for footprint in footprints:
        if np.abs(footprint.mean(axis=0) - source).max() > reach + 20:
            continue
        away = footprint - source
        far = footprint + 3 * reach * away / np.maximum(
            np.linalg.norm(away, axis=1, keepdims=True), 1e-6
        )
        hull = cv2.convexHull(np.concatenate([footprint, far]).astype(np.float32))[:, 0]
        fine = (hull + plan.side / 2) / cell - 0.5 - (columns.start, rows.start)
        cv2.fillConvexPoly(mask, np.rint(fine * 16).astype(np.int32), 0.05, cv2.LINE_8, 4)
    return mask
