"""What a scene holds: ground, lamps, buildings, trees, small lights, and what moves."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from nat2024.night.arrays import Colour, Light, Points, log_uniform
from nat2024.night.bodies import Body, Kind, make_body
from nat2024.night.buildings import Building, make_building
from nat2024.night.camera import Flight
from nat2024.night.ground import PIXELS, Plan
from nat2024.night.lamps import CELLS, Lamp, ambient_light, lamp_colour, light_map, place_lamps
from nat2024.night.trees import Tree, crowns, make_tree
from nat2024.types import Floats

_LEVELS = 4


@dataclass(frozen=True, slots=True)
class Mover:
    """A body on its way; arrays have one entry a frame and one more.

    Attributes:
        body: what moves.
        places: (n, 2) metres.
        headings: (n,) radians.
        phases: (n,) of its step, radians.
    """

    body: Body
    places: Points
    headings: Floats
    phases: Floats


@dataclass(frozen=True, slots=True)
class SmallLights:
    """Many points of light that stay where they are.

    Attributes:
        places: (n, 3) metres.
        radii: (n,) metres.
        radiance: float32 (n, 3) BGR.
    """

    places: Points
    radii: Floats
    radiance: Light


@dataclass(frozen=True, slots=True)
class Scene:
    """Everything in front of the camera.

    Attributes:
        plan: the ground.
        lamps: over it.
        ambient: light everywhere.
        light: irradiance of the ground; see `light_map`.
        levels: light that the ground sends, each level half the size of the one before.
        grey: uint8 (h, w) mean albedo of the ground times 255, at half the plan's size.
        buildings: on it.
        trees: on it.
        crowns: pictures of the trees.
        lights: all small lights, lamps included.
        movers: all that moves; the first is the target.
        flight: of the camera.
    """

    plan: Plan
    lamps: tuple[Lamp, ...]
    ambient: Colour
    light: Light
    levels: tuple[Light, ...]
    grey: npt.NDArray[np.uint8]
    buildings: tuple[Building, ...]
    trees: tuple[Tree, ...]
    crowns: tuple[tuple[Light, Light], ...]
    lights: SmallLights
    movers: tuple[Mover, ...]
    flight: Flight
    lamp_heads: Floats = field(repr=False)

    def light_at(self, place: Floats) -> Colour:
        """Irradiance at a place on the ground, BGR."""
        cell = np.clip((place[:2] / self.plan.side + 0.5) * CELLS, 0, CELLS - 1).astype(int)
        return np.asarray(self.light[cell[1], cell[0]], dtype=np.float32)


def build_scene(
    rng: np.random.Generator,
    plan: Plan,
    flight: Flight,
    target: Mover,
    occluders: Sequence[Tree],
    others: int,
    photographs: Sequence[Light] = (),
) -> Scene:
    """Put everything else around a target whose way and whose camera are decided.

    Args:
        rng: where chance comes from.
        plan: the ground.
        flight: of the camera.
        target: what is tracked.
        occluders: trees that are meant to hide it.
        others: about how many other movers of the target's world there are.
        photographs: reflectance of photographs for walls.
    """
    ambient = ambient_light(rng)
    lamps = place_lamps(rng, plan)
    lines = _sight_lines(flight, target)
    buildings = _buildings(rng, plan, lines, ambient, photographs)
    trees = [*_trees(rng, plan, lines), *occluders]
    movers = (target, *_others(rng, plan, target, others))
    stands = [building.footprint for building in buildings]
    stands += [_square_around(tree.place, 0.55 * tree.radius) for tree in trees]
    light = light_map(plan, lamps, ambient, stands)
    return Scene(
        plan=plan,
        lamps=lamps,
        ambient=ambient,
        light=light,
        levels=_levels(plan, light),
        grey=_grey(plan),
        buildings=buildings,
        trees=tuple(trees),
        crowns=crowns(rng),
        lights=_small_lights(rng, plan, lamps),
        movers=movers,
        flight=flight,
        lamp_heads=np.array([lamp.position for lamp in lamps]).reshape(-1, 3),
    )


def _levels(plan: Plan, light: Light) -> tuple[Light, ...]:
    import cv2

    fine = cv2.resize(light, (PIXELS, PIXELS), interpolation=cv2.INTER_LINEAR)
    levels = [np.asarray(fine * plan.albedo, dtype=np.float32)]
    for number in range(1, _LEVELS):
        side = PIXELS >> number
        smaller = cv2.resize(levels[-1], (side, side), interpolation=cv2.INTER_AREA)
        levels.append(np.asarray(smaller, dtype=np.float32))
    return tuple(levels)


def _grey(plan: Plan) -> npt.NDArray[np.uint8]:
    import cv2

    half = cv2.resize(plan.albedo, (PIXELS // 2, PIXELS // 2), interpolation=cv2.INTER_AREA)
    grey = np.asarray(half, dtype=np.float32).mean(axis=2)
    return np.asarray(np.rint(255 * grey), dtype=np.uint8)


def _square_around(place: tuple[float, float], half: float) -> Points:
    x, y = place
    return np.array(
        [[x - half, y - half], [x + half, y - half], [x + half, y + half], [x - half, y + half]]
    )


def _sight_lines(flight: Flight, target: Mover) -> Points:
    """(m, 2, 3): from the target to the camera, every few frames."""
    lines = []
    for index in range(0, len(flight.distance), 4):
        x, y = target.places[index]
        lines.append([(x, y, 0.5 * target.body.size[2]), flight.camera(index).position])
    return np.array(lines)


def _clear(lines: Points, middle: Floats, radius: float) -> bool:
    """Whether a ball is out of the way of all lines of sight."""
    start, ray = lines[:, 0], lines[:, 1] - lines[:, 0]
    along = ((middle - start) * ray).sum(axis=1) / (ray**2).sum(axis=1)
    nearest = start + np.clip(along, 0, 1)[:, None] * ray
    return bool(np.linalg.norm(nearest - middle, axis=1).min() > radius)


def _on_ground(plan: Plan, x: float, y: float, margin: float) -> bool:
    """Whether a place is off the roads, the square and the water."""
    for road in plan.roads:
        if abs((x if road.along_y else y) - road.centre) < road.half + margin:
            return False
    if plan.square is not None:
        x0, y0, x1, y1 = plan.square
        if x0 - margin < x < x1 + margin and y0 - margin < y < y1 + margin:
            return False
    return plan.bank is None or x < plan.bank - 2 - margin


def _buildings(
    rng: np.random.Generator,
    plan: Plan,
    lines: Points,
    ambient: Colour,
    photographs: Sequence[Light],
) -> tuple[Building, ...]:
    found: list[Building] = []
    for _ in range(60):
        x, y = rng.uniform(-0.5, 0.5, size=2) * plan.side
        width, depth = rng.uniform(10, 26, size=2)
        height = log_uniform(rng, 6, 32)
        half = 0.5 * float(np.hypot(width, depth))
        taken = any(_near(b.box, x, y, half + 3) for b in found)
        if taken or not _on_ground(plan, x, y, 0.5 * max(width, depth) + 4.5):
            continue
        levels = np.arange(0, height + half, half)
        column = [np.array([x, y, z]) for z in levels]
        if not all(_clear(lines, place, half * 1.15 + 1.5) for place in column):
            continue
        box = (x - width / 2, y - depth / 2, x + width / 2, y + depth / 2)
        wall = photographs[int(rng.integers(len(photographs)))] if photographs else None
        found.append(make_building(rng, box, height, ambient, wall))
        if len(found) >= 14:
            break
    return tuple(found)


def _near(box: tuple[float, float, float, float], x: float, y: float, reach: float) -> bool:
    return box[0] - reach < x < box[2] + reach and box[1] - reach < y < box[3] + reach


def _trees(rng: np.random.Generator, plan: Plan, lines: Points) -> list[Tree]:
    spots: list[tuple[float, float]] = []
    step = float(rng.uniform(7, 12))
    for road in plan.roads:
        for along in np.arange(-plan.side / 2, plan.side / 2, step):
            for sign in (-1, 1):
                across = road.centre + sign * (road.half + float(rng.uniform(2.5, 4)))
                spots.append((across, along) if road.along_y else (along, across))
    wild = rng.uniform(-0.5, 0.5, size=(26, 2)) * plan.side
    spots += [(float(x), float(y)) for x, y in wild]
    dense = float(rng.uniform(0.25, 0.8))
    trees = []
    for x, y in spots:
        radius, height = float(rng.uniform(1.2, 2.8)), float(rng.uniform(3.0, 5.5))
        keep = rng.random() < dense and _on_ground(plan, x, y, 0.8)
        if keep and _clear(lines, np.array([x, y, height]), radius + 1.8):
            trees.append(make_tree(rng, x, y, height, radius))
    return trees


def _small_lights(rng: np.random.Generator, plan: Plan, lamps: Sequence[Lamp]) -> SmallLights:
    places = [lamp.position for lamp in lamps]
    radii = [0.2] * len(lamps)
    radiance = [lamp.glare * lamp.strength * lamp.tint for lamp in lamps]
    half = plan.side / 2
    for _ in range(int(rng.integers(3, 9))):
        string = _string(rng, half)
        light = lamp_colour(rng) * np.float32(log_uniform(rng, 1, 12))
        kept = [p for p in string if _on_ground(plan, p[0], p[1], -0.5)]
        places += kept
        radii += [0.12] * len(kept)
        radiance += [light] * len(kept)
    for _ in range(int(rng.integers(10, 60))):  # the town behind
        angle = float(rng.uniform(0, 2 * np.pi))
        reach = half * float(rng.uniform(1.0, 1.5))
        places.append((reach * np.sin(angle), reach * np.cos(angle), float(rng.uniform(2, 20))))
        radii.append(0.25)
        radiance.append(lamp_colour(rng) * np.float32(log_uniform(rng, 0.3, 10)))
    return SmallLights(
        np.array(places, dtype=np.float64).reshape(-1, 3),
        np.array(radii),
        np.array(radiance, dtype=np.float32).reshape(-1, 3),
    )


def _string(rng: np.random.Generator, half: float) -> list[tuple[float, float, float]]:
    """Dots in a line or on an arc, near the ground."""
    count, pitch = int(rng.integers(8, 36)), float(rng.uniform(0.8, 3.0))
    x, y = rng.uniform(-0.8, 0.8, size=2) * half
    angle, bend = rng.uniform(0, 2 * np.pi), rng.normal(0, 0.08)
    height = float(rng.uniform(0.1, 2.5))
    dots = []
    for _ in range(count):
        dots.append((float(x), float(y), height))
        x, y, angle = x + pitch * np.sin(angle), y + pitch * np.cos(angle), angle + bend
    return dots


def _others(rng: np.random.Generator, plan: Plan, target: Mover, count: int) -> list[Mover]:
    frames = len(target.places)
    movers = []
    for road in plan.roads:
        for number in range(-road.lanes, road.lanes):
            movers += _lane(rng, plan, target, road_number=plan.roads.index(road), lane=number)
    walkers = count if plan.place == "plaza" else max(2, count // 2)
    for _ in range(walkers):
        place = _walking_place(rng, plan)
        movers.append(walk(rng, make_body(rng, "person"), place, frames, plan))
    if plan.bank is not None:
        for _ in range(2):
            x, y = plan.bank + rng.uniform(6, 40), rng.uniform(-0.4, 0.4) * plan.side
            heading = float(rng.choice([0.0, np.pi]))
            boat = make_body(rng, "boat")
            movers.append(drive(boat, np.array([x, y]), heading, float(rng.uniform(0, 4)), frames))
    kept = [m for m in movers if _apart(m, target)]
    middle = target.places[frames // 2]
    kept.sort(key=lambda m: float(np.linalg.norm(m.places[frames // 2] - middle)))
    return kept[:_MOST]


def _apart(mover: Mover, target: Mover) -> bool:
    reach = 0.5 * (mover.body.size[0] + target.body.size[0]) + 0.4
    same_lane = np.abs(mover.places - target.places).min(axis=1) < 1.2
    gaps = np.linalg.norm(mover.places - target.places, axis=1)
    crowded = np.where(same_lane, gaps < reach, gaps < 0.5 * reach)
    return not bool(crowded.any())


def _walking_place(rng: np.random.Generator, plan: Plan) -> Floats:
    if plan.square is not None:
        x0, y0, x1, y1 = plan.square
        return np.array([rng.uniform(x0, x1), rng.uniform(y0, y1)])
    road = plan.roads[int(rng.integers(len(plan.roads)))]
    across = road.centre + rng.choice([-1, 1]) * (road.half + rng.uniform(0.8, 3.2))
    along = rng.uniform(-0.3, 0.3) * plan.side
    return np.array([across, along] if road.along_y else [along, across])


def _lane(
    rng: np.random.Generator, plan: Plan, target: Mover, road_number: int, lane: int
) -> list[Mover]:
    """Traffic of one lane at one speed; the outer lanes are parked in places."""
    road = plan.roads[road_number]
    across, sign = road.lane(lane)
    outer = lane in (-road.lanes, road.lanes - 1)
    parked = outer and rng.random() < 0.5
    speed = 0.0 if parked or road_number else float(rng.uniform(3, 12))
    heading = _road_heading(road.along_y, sign)
    frames = len(target.places)
    movers = []
    along = -plan.side / 2 + float(rng.uniform(0, 10))
    while along < plan.side / 2:
        kind: Kind = str(rng.choice(_TRAFFIC))  # type: ignore[assignment]
        body = make_body(rng, kind, lights=not parked)
        blocked = road_number > 0 or len(plan.roads) > 1
        stop = blocked and not speed and abs(along) < plan.roads[0].half + 12
        if not stop and rng.random() < 0.75:
            place = np.array([across, along] if road.along_y else [along, across])
            movers.append(drive(body, place, heading, speed, frames))
        along += body.size[0] + float(rng.uniform(1.2, 4) if parked else log_uniform(rng, 6, 45))
    return movers


def _road_heading(along_y: bool, sign: int) -> float:
    if along_y:
        return 0.0 if sign > 0 else float(np.pi)
    return float(np.pi / 2) if sign > 0 else float(-np.pi / 2)


_MOST = 40
"""Movers beside the target; the farthest are left out."""

_TRAFFIC = ("car",) * 10 + ("van", "van", "truck", "bus", "bike")

FRAME_RATE = 30.0
"""Frames a second of rendered video."""


def drive(
    body: Body, place: Floats, heading: float, speed: float, frames: int, turn: Floats | None = None
) -> Mover:
    """Move at a speed (metres a second), turning by `turn` (radians from the first frame on)."""
    headings = heading + (turn if turn is not None else np.zeros(frames))
    step = speed / FRAME_RATE * np.stack([np.sin(headings), np.cos(headings)], axis=1)
    places = place + np.cumsum(step, axis=0) - step[0]
    phases = np.cumsum(np.full(frames, speed / FRAME_RATE)) * 2 * np.pi / 1.4
    return Mover(body, places, headings, phases)


def walk(rng: np.random.Generator, body: Body, place: Floats, frames: int, plan: Plan) -> Mover:
    """Walk about, along the road or anywhere on a square; some stand."""
    heading = float(rng.uniform(0, 2 * np.pi))
    if plan.roads:
        heading = _road_heading(plan.roads[0].along_y, int(rng.choice([-1, 1])))
    speed = 0.0 if rng.random() < 0.25 else float(rng.uniform(0.8, 1.8))
    turn = np.cumsum(rng.normal(0, 0.015, size=frames)) if not plan.roads else None
    mover = drive(body, place, heading, speed, frames, turn)
    return Mover(body, mover.places, mover.headings, mover.phases + float(rng.uniform(0, 6)))
