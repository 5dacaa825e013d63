"""Lights that are seen themselves: lamp heads, strings, lights of vehicles, images in water."""

from collections.abc import Sequence

import numpy as np

from nat2024.night.arrays import Colour, Light
from nat2024.night.bodies import Lantern
from nat2024.night.buildings import hides
from nat2024.night.camera import Camera
from nat2024.night.scene import Mover, Scene, SmallLights
from nat2024.night.sprites import add_spot, pose
from nat2024.types import Floats


def add_lanterns(
    frame: Light, mover: Mover, camera: Camera, index: int, keep: Light | None
) -> None:
    """The lights of a body that face the camera."""
    if not mover.body.lanterns or (keep is not None and keep.mean() < 0.5):
        return
    heading = float(mover.headings[index])
    turn = pose(mover.places[index], heading)
    places = np.array([lantern.position for lantern in mover.body.lanterns])
    pixels, depth = camera.project(places @ turn[:, :3].T + turn[:, 3])
    ray = np.array(camera.position) - np.array([*mover.places[index], 0.7])
    ahead = float(ray[:2] @ np.array([np.sin(heading), np.cos(heading)]) / np.linalg.norm(ray))
    for (x, y), far, lantern in zip(pixels, depth, mover.body.lanterns, strict=True):
        radiance = lantern.radiance * np.float32(_facing(lantern, ahead))
        if far > 1 and radiance.max() > 0.01:
            _add_light(frame, float(x), float(y), lantern.radius * camera.focal / far, radiance)


def _facing(lantern: Lantern, ahead: float) -> float:
    """How much of a light the camera sees: reflectors shine forward, and a little aside."""
    if lantern.facing == 0:
        return 1.0
    return float(max(0.0, lantern.facing * ahead + 0.08) ** 1.5)


def _add_light(
    frame: Light, x: float, y: float, radius: float, radiance: Colour, tall: float = 1.0
) -> None:
    """A round light, spread over a pixel at least with all its light kept."""
    sigma = float(np.hypot(0.6 * radius, 0.55))
    share = min(1.0, radius**2 / (2 * sigma**2))
    add_spot(frame, x, y, sigma, radiance * np.float32(share), tall)


def add_lights(
    frame: Light, scene: Scene, camera: Camera, index: int, outlines: Sequence[Floats]
) -> None:
    """Lamp heads and all small lights that no building hides, and their image in water."""
    lights = scene.lights
    _points(frame, scene, camera, lights, np.ones(len(lights.places)), outlines)
    if scene.plan.bank is None:
        return
    eye = np.array(camera.position)
    mirrored = lights.places * (1, 1, -1)
    share = lights.places[:, 2:] / (lights.places[:, 2:] + eye[2])
    surface = mirrored + share * (eye - mirrored)
    wet = (surface[:, 0] > scene.plan.bank) & (lights.places[:, 2] > 0.5)
    image = SmallLights(mirrored[wet], lights.radii[wet], lights.radiance[wet] * np.float32(0.12))
    ripple = np.random.default_rng(index).uniform(0.6, 1.4, size=int(wet.sum()))
    _points(frame, scene, camera, image, ripple, outlines, tall=7.0)


def _points(
    frame: Light,
    scene: Scene,
    camera: Camera,
    lights: SmallLights,
    factors: Floats,
    outlines: Sequence[Floats],
    tall: float = 1.0,
) -> None:
    pixels, depth = camera.project(lights.places)
    low, high = -8.0, np.array(camera.size) + 8
    inside = (depth > 1) & (pixels > low).all(axis=1) & (pixels < high).all(axis=1)
    for building, outline in zip(scene.buildings, outlines, strict=True):
        behind = inside & hides(building, camera, lights.places)
        if behind.any():
            for number in np.flatnonzero(behind).tolist():
                inside[number] = not _within(outline, pixels[number])
    for number in np.flatnonzero(inside).tolist():
        x, y = pixels[number]
        radius = float(lights.radii[number] * camera.focal / depth[number])
        radiance = lights.radiance[number] * np.float32(factors[number])
        _add_light(frame, float(x), float(y), radius, radiance, tall)


def _within(outline: Floats, point: Floats) -> bool:
    import cv2

    place = (float(point[0]), float(point[1]))
    return cv2.pointPolygonTest(outline.astype(np.float32), place, False) >= 0
