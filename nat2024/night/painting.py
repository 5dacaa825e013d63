"""One frame of a scene: the light that reaches the camera, and what of the target it sees."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from nat2024.night.arrays import Light, colour
from nat2024.night.buildings import draw_building, hides, hull_in, soft_mask
from nat2024.night.camera import Camera
from nat2024.night.ground import PIXELS
from nat2024.night.scene import Mover, Scene
from nat2024.night.shining import add_lanterns, add_lights
from nat2024.night.sight import Sight, Watch
from nat2024.night.sprites import Sprite, draw_body, lay, line_kernel, pose
from nat2024.night.trees import draw_tree
from nat2024.types import Flags, Floats

SHUTTER = 0.5
"""Share of the time between frames that the shutter is open."""

_BAND = 24
"""Rows of the frame whose ground is taken from one level of the plan at least."""


_SMALLEST = 4.0
_SHADOW_FROM = 12.0
"""Lengths in pixels from which things are drawn, and from which they have a shadow."""


def paint(scene: Scene, index: int) -> tuple[Light, Sight]:
    """The light of frame `index`, float32 (H, W, 3) BGR, and what it shows of the target."""
    camera, later = scene.flight.camera(index), scene.flight.camera(index + 1)
    frame = _ground(scene, camera, later)
    _beams(frame, scene, camera, index)
    standing = _standing(scene, camera, later, index)
    for number in standing.order:
        if number < len(scene.movers) and standing.lengths[number] >= _SHADOW_FROM:
            _shadow(frame, scene, camera, scene.movers[number], index)
    order = sorted(scene.buildings, key=lambda b: -_distance(camera, b.footprint.mean(axis=0)))
    for building in order:
        draw_building(frame, building, camera)
    outlines = [hull_in(building, camera) for building in scene.buildings]
    sight = _stand(frame, scene, standing, camera, index, outlines)
    add_lights(frame, scene, camera, index, outlines)
    return frame, sight


def _distance(camera: Camera, place: Floats) -> float:
    return float(np.hypot(*(place[:2] - np.array(camera.position[:2]))))


def _plan_matrix(scene: Scene, camera: Camera) -> Floats:
    """From plan pixels to frame pixels, both counted from the middle of the first."""
    scale, half = scene.plan.side / PIXELS, scene.plan.side / 2
    to_world = np.array([[scale, 0, 0.5 * scale - half], [0, scale, 0.5 * scale - half], [0, 0, 1]])
    shift = np.array([[1, 0, -0.5], [0, 1, -0.5], [0, 0, 1]])
    return np.asarray(shift @ camera.ground() @ to_world)


def _ground(scene: Scene, camera: Camera, later: Camera) -> Light:
    import cv2

    width, height = camera.size
    matrix = _plan_matrix(scene, camera)
    frame = np.empty((height, width, 3), dtype=np.float32)
    border = (scene.ambient * np.float32(0.04)).tolist()
    for start, end, level in _bands(matrix, camera.size, len(scene.levels)):
        factor = 2.0**level
        coarse = np.array(
            [[factor, 0, 0.5 * factor - 0.5], [0, factor, 0.5 * factor - 0.5], [0, 0, 1]]
        )
        up = np.array([[1, 0, 0], [0, 1, -start], [0, 0, 1.0]])
        frame[start:end] = cv2.warpPerspective(
            scene.levels[level],
            up @ matrix @ coarse,
            (width, end - start),
            flags=cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_CONSTANT,
            borderValue=border,
        )
    kernel = line_kernel(_view_motion(camera, later))
    if kernel is not None:
        frame = np.asarray(cv2.filter2D(frame, -1, kernel), dtype=np.float32)
    return frame


def _bands(matrix: Floats, size: tuple[int, int], levels: int) -> list[tuple[int, int, int]]:
    """Rows (start, end) of the frame with the level of the plan that suits them."""
    width, height = size
    inverse = np.linalg.inv(matrix)
    rows = np.arange(0, height, _BAND)
    middle = np.minimum(rows + _BAND / 2, height - 1)
    found = []
    for row, y in zip(rows.tolist(), middle.tolist(), strict=True):
        spots = np.array([[width / 2, y, 1], [width / 2 + 1, y, 1], [width / 2, y + 1, 1]])
        seen = spots @ inverse.T
        flat = seen[:, :2] / seen[:, 2:]
        step = np.hypot(*(flat[1] - flat[0])) * np.hypot(*(flat[2] - flat[0]))
        level = int(np.clip(np.round(0.5 * np.log2(max(step, 1e-6)) - 0.15), 0, levels - 1))
        found.append((row, min(row + _BAND, height), level))
    merged = [found[0]]
    for start, end, level in found[1:]:
        if level == merged[-1][2]:
            merged[-1] = (merged[-1][0], end, level)
        else:
            merged.append((start, end, level))
    return merged


def _motions(camera: Camera, later: Camera, places: Floats, after: Floats) -> Floats:
    """How far places on the ground move in the frame while the shutter is open, (n, 2) pixels."""
    flat = np.zeros((len(places), 1))
    step = later.project(np.hstack([after, flat]))[0] - camera.project(np.hstack([places, flat]))[0]
    return np.asarray(np.clip(step * SHUTTER, -12, 12))


def _view_motion(camera: Camera, later: Camera) -> tuple[float, float]:
    """The same for what is in the middle of the view."""
    back = camera.position[2] / np.tan(camera.pitch)
    ahead = np.array([[np.sin(camera.yaw), np.cos(camera.yaw)]])
    middle = np.array([camera.position[:2]]) + back * ahead
    x, y = _motions(camera, later, middle, middle)[0]
    return float(x), float(y)


def _beams(frame: Light, scene: Scene, camera: Camera, index: int) -> None:
    """Head lights on the ground: what the road sends back of them."""
    import cv2

    lit = [m for m in scene.movers if m.body.beam]
    if not lit:
        return
    matrix = _plan_matrix(scene, camera)
    half = matrix @ np.array([[2, 0, 0.5], [0, 2, 0.5], [0, 0, 1.0]])
    size = camera.size
    for mover in lit:
        length, front = 16.0, mover.body.size[0] / 2
        wide = 3.6
        own = np.array(
            [
                [front, -wide, 0],
                [front + length, -wide, 0],
                [front + length, wide, 0],
                [front, wide, 0],
            ]
        )
        turn = pose(mover.places[index], float(mover.headings[index]))
        pixels, depth = camera.project(own @ turn[:, :3].T + turn[:, 3])
        if depth.min() < 1:
            continue
        low = np.maximum(np.floor(pixels.min(axis=0)).astype(int), 0)
        high = np.minimum(np.ceil(pixels.max(axis=0)).astype(int), size)
        if (high - low < 2).any():
            continue
        source = np.array([[0, 0], [63, 0], [63, 31], [0, 31]], dtype=np.float32)
        target = (pixels - low - 0.5).astype(np.float32)
        extent = (int(high[0] - low[0]), int(high[1] - low[1]))
        cone = cv2.warpPerspective(
            _CONE, cv2.getPerspectiveTransform(source, target), extent, flags=cv2.INTER_LINEAR
        )
        up = np.array([[1, 0, -low[0]], [0, 1, -low[1]], [0, 0, 1.0]])
        albedo = cv2.warpPerspective(scene.grey, up @ half, extent, flags=cv2.INTER_LINEAR)
        strength = cone * albedo * np.float32(mover.body.beam / 255)
        frame[low[1] : high[1], low[0] : high[0]] += strength[..., None] * _WHITE


def _cone() -> Light:
    """Light on the ground before a vehicle, along the first axis away from it."""
    along = np.linspace(0.02, 1, 64, dtype=np.float32)
    across = np.linspace(-1, 1, 32, dtype=np.float32)[:, None]
    width = 0.22 + 0.6 * along
    shape = np.exp(-((across / width) ** 2) * 2) * np.exp(-3 * along) * (1 - np.exp(-25 * along))
    fade = np.clip((1 - np.abs(across)) * 6, 0, 1) * np.clip((1 - along) * 5, 0, 1)
    return np.asarray(shape * fade * 2.2, dtype=np.float32)


_CONE = _cone()
_WHITE = colour(0.85, 0.97, 1.0)


def _shadow(frame: Light, scene: Scene, camera: Camera, mover: Mover, index: int) -> None:
    """Take the light of the strongest lamp away where the body stands in it."""
    import cv2

    place = mover.places[index]
    heads = scene.lamp_heads
    middle = camera.project(np.array([[place[0], place[1], 0.0]]))[0]
    if not len(heads) or not _near_frame(middle, camera.size, 0.3 * max(camera.size)):
        return
    squared = ((heads[:, :2] - place) ** 2).sum(axis=1)
    strengths = np.array([lamp.strength for lamp in scene.lamps])
    share = strengths * (1 + squared / heads[:, 2] ** 2) ** -1.5
    number = int(share.argmax())
    dark = 0.85 * min(1.0, float(share[number]) / max(float(scene.light_at(place).mean()), 1e-6))
    if dark < 0.1:
        return
    length, width, height = mover.body.size
    height = min(height, 0.8 * heads[number, 2])
    flat = np.array(
        [[x, y, 0.0] for x in (-length / 2, length / 2) for y in (-width / 2, width / 2)]
    )
    flat *= 0.92
    turn = pose(place, float(mover.headings[index]))
    foot = (flat @ turn[:, :3].T + turn[:, 3])[:, :2]
    lamp = heads[number]
    cast = lamp[:2] + (foot - lamp[:2]) * (lamp[2] / (lamp[2] - height))
    outline = np.concatenate([foot, cast])
    pixels, depth = camera.project(np.column_stack([outline, np.zeros(len(outline))]))
    if depth.min() < 1 or not _near_frame(pixels, camera.size):
        return
    hull = cv2.convexHull(pixels.astype(np.float32))[:, 0].astype(np.float64)
    low = np.maximum(np.floor(hull.min(axis=0)).astype(int) - 3, 0)
    high = np.minimum(np.ceil(hull.max(axis=0)).astype(int) + 3, camera.size)
    if (low >= high).any():
        return
    mask = soft_mask(hull - low, (int(high[0] - low[0]), int(high[1] - low[1])))
    soft = np.asarray(cv2.GaussianBlur(mask, (0, 0), 1.0), dtype=np.float32)
    frame[low[1] : high[1], low[0] : high[0]] *= (1 - np.float32(dark) * soft)[..., None]


def _near_frame(pixels: Floats, size: tuple[int, int], margin: float = 0.0) -> bool:
    low, high = pixels.min(axis=0) - margin, pixels.max(axis=0) + margin
    return bool((high > 0).all() and (low < size).all() and (high - low).max() < 3 * max(size))


@dataclass(frozen=True, slots=True)
class _Standing:
    """Everything that stands on the ground in one frame: movers first, then trees.

    Attributes:
        places: (n, 2) metres.
        motions: (n, 2) pixels while the shutter is open.
        lengths: (n,) about how long they are in the frame, in pixels.
        order: numbers of those that may be in the frame and are not too small, the farthest first.
        hidden: bool (n, buildings), which building is on the way to the camera.
    """

    places: Floats
    motions: Floats
    lengths: Floats
    order: list[int]
    hidden: Flags


def _standing(scene: Scene, camera: Camera, later: Camera, index: int) -> _Standing:
    movers, trees = scene.movers, scene.trees
    feet = [m.places[index] for m in movers] + [np.array(tree.place) for tree in trees]
    later_feet = [m.places[index + 1] for m in movers] + feet[len(movers) :]
    places = np.array(feet)
    heights = np.array([m.body.size[2] / 2 for m in movers] + [tree.height for tree in trees])
    reach = np.array([m.body.size[0] for m in movers] + [1.5 * tree.radius for tree in trees]) + 1
    pixels, depth = camera.project(np.column_stack([places, heights]))
    lengths = reach * camera.focal / np.maximum(depth, 0.5)
    margin = lengths[:, None]
    near = lengths > _SMALLEST
    near[0] = True
    near &= (depth > 1) & (pixels > -margin).all(axis=1)
    near &= (pixels < np.array(camera.size) + margin).all(axis=1)
    far = np.hypot(*(places - np.array(camera.position[:2])).T)
    crown = np.arange(len(places)) >= len(movers)
    aerial = camera.pitch > 1.2  # from above, crowns are over whatever is below them
    order = np.lexsort((-far, crown)) if aerial else np.argsort(-far, kind="stable")
    hidden = [hides(building, camera, places) for building in scene.buildings]
    return _Standing(
        places,
        _motions(camera, later, places, np.array(later_feet)),
        lengths,
        [int(n) for n in order if near[n]],
        np.array(hidden).reshape(len(scene.buildings), len(places)).T,
    )


def _stand(
    frame: Light,
    scene: Scene,
    standing: _Standing,
    camera: Camera,
    index: int,
    outlines: Sequence[Floats],
) -> Sight:
    """Draw trees and movers from far to near, and watch what happens to the target."""
    watch = Watch(camera.size)
    for number in standing.order:
        x, y = standing.motions[number].tolist()
        sprite = _draw(scene, camera, index, number, (x, y))
        if sprite is None:
            continue
        hiding = np.flatnonzero(standing.hidden[number])
        keep = _unhidden(sprite, [outlines[int(building)] for building in hiding])
        lay(frame, sprite, keep)
        watch.see(sprite, keep, is_target=number == 0)
        if number < len(scene.movers):
            add_lanterns(frame, scene.movers[number], camera, index, keep)
    return watch.sight(float(scene.light_at(scene.movers[0].places[index]).mean()))


def _draw(
    scene: Scene, camera: Camera, index: int, number: int, motion: tuple[float, float]
) -> Sprite | None:
    """Draw mover `number`, or the tree that comes after all movers."""
    if number >= len(scene.movers):
        tree = scene.trees[number - len(scene.movers)]
        light = scene.light_at(np.array(tree.place))
        return draw_tree(tree, camera, light, scene.crowns[tree.kind], motion)
    mover = scene.movers[number]
    place, heading = mover.places[index], float(mover.headings[index])
    light, phase = scene.light_at(place), float(mover.phases[index])
    return draw_body(mover.body, camera, place, heading, light, phase, motion)


def _unhidden(sprite: Sprite, outlines: Sequence[Floats]) -> Light | None:
    """Share of each pixel of a sprite that no building hides; None for all of them."""
    keep = None
    height, width = sprite.cover.shape
    for outline in outlines:
        cover = 1 - soft_mask(outline - np.array(sprite.corner), (width, height))
        keep = cover if keep is None else keep * cover
    return keep
