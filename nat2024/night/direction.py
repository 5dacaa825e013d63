"""Who goes where: the target's way, the camera's flight, and trees put in between."""

from dataclasses import dataclass

import numpy as np

from nat2024.night.arrays import log_uniform
from nat2024.night.bodies import Body, Kind
from nat2024.night.camera import Flight, pulse, sway
from nat2024.night.ground import Place, Plan
from nat2024.night.scene import FRAME_RATE, Mover, drive
from nat2024.night.trees import Tree, make_tree
from nat2024.types import Floats

SPEEDS: dict[Kind, tuple[float, float]] = {
    "car": (5, 12),
    "van": (5, 11),
    "truck": (4, 9),
    "bus": (4, 9),
    "bike": (4, 9),
    "person": (1.2, 3.2),
    "boat": (3, 7),
}
"""Metres a second."""

_FOCAL = 0.85
"""Focal length in frame widths: a field of view of 61 degrees, as of most drones."""


@dataclass(frozen=True, slots=True)
class Direction:
    """How a sequence is filmed.

    Attributes:
        length: of the target in the frame, in shares of the frame's width, at the start.
        pitch: how far the camera looks down, radians.
        zoom: how much nearer (above 1) or farther the camera comes till the end.
        turn: how far it turns till the end, radians.
        sway: how much it sways, 1 being usual.
    """

    length: float
    pitch: float
    zoom: float
    turn: float
    sway: float


def draw_direction(rng: np.random.Generator, kind: Kind) -> Direction:
    """A way of filming by chance."""
    steep = rng.random() < 0.3 and kind != "person"
    pitch = float(rng.uniform(1.25, 1.55) if steep else rng.uniform(0.56, 1.0))
    return Direction(
        length=log_uniform(rng, 0.04, 0.085),
        pitch=pitch,
        zoom=log_uniform(rng, 0.7, 1.5),
        turn=float(rng.normal(0, 0.12)),
        sway=log_uniform(rng, 0.5, 1.6),
    )


def first_distance(direction: Direction, body: Body) -> float:
    """Metres from the camera to the target at the start."""
    length, _, height = body.size
    seen = height * np.cos(direction.pitch) + 0.4 if body.kind == "person" else 0.85 * length
    return float(_FOCAL * seen / direction.length)


def world_side(direction: Direction, distance: float) -> float:
    """Metres that the plan must be wide for the camera to see ground nearly everywhere."""
    far = distance * max(1.0, 1 / min(direction.zoom, 1.0))
    height = far * np.sin(direction.pitch)
    ahead = height * (1 / np.tan(max(direction.pitch - 0.32, 0.2)) - 1 / np.tan(direction.pitch))
    return float(np.clip(2 * max(ahead, 0.75 * far) + 24, 60, 260))


def target_way(rng: np.random.Generator, plan: Plan, body: Body, frames: int) -> Mover:
    """The target's way through the middle of the plan; `frames` + 1 entries."""
    kind = body.kind
    speed = float(rng.uniform(*SPEEDS[kind]))
    count = frames + 1
    run = speed * count / FRAME_RATE
    turn = np.zeros(count)
    if kind == "boat":
        across = (plan.bank or 0.0) + float(rng.uniform(7, 16))
        start, heading = np.array([across, -0.5 * run]), 0.0
    elif kind == "person":
        heading = float(rng.uniform(0, 2 * np.pi)) if not plan.roads else 0.0
        turn = np.cumsum(rng.normal(0, 0.012, size=count))
        start = -0.5 * run * np.array([np.sin(heading), np.cos(heading)])
        if plan.roads:
            start[0] += plan.roads[0].centre + plan.roads[0].half + 1.6
    else:
        lane = int(rng.integers(0, plan.roads[0].lanes))
        across, _ = plan.roads[0].lane(lane)
        start, heading = np.array([across, -0.5 * run]), 0.0
        if plan.place == "crossing" and rng.random() < 0.35:
            turn = _bend(rng, count)
    mover = drive(body, start, heading, speed, count, turn)
    return Mover(body, mover.places, mover.headings, mover.phases)


def _bend(rng: np.random.Generator, count: int) -> Floats:
    """A turn to the right or to the left in the middle of the way."""
    share = np.clip((np.arange(count) / count - 0.35) / 0.4, 0, 1)
    smooth = share * share * (3 - 2 * share)
    return np.asarray(smooth * float(rng.choice([-1, 1])) * np.pi / 2)


def flight_over(
    rng: np.random.Generator,
    target: Mover,
    direction: Direction,
    distance: float,
    size: tuple[int, int],
    leave: float = 0.0,
) -> Flight:
    """A drone that follows the target a little behind, swaying, zooming and turning.

    Args:
        rng: where chance comes from.
        target: what it follows.
        direction: how it is filmed.
        distance: at the start.
        size: (width, height) of the frame.
        leave: how far the view leaves the target for a while, in frame widths; 0 for never.
    """
    frames = len(target.places)
    progress = np.arange(frames) / max(frames - 1, 1)
    smooth = progress * progress * (3 - 2 * progress)
    far = distance * direction.zoom ** (-smooth)
    seen = far / _FOCAL  # metres across the frame
    aim = _smoothed(target.places, 15)
    reach = 0.07 * direction.sway
    for axis in (0, 1):
        aim[:, axis] += seen * (sway(rng, frames, reach, 0.05 * reach))
        aim[:, axis] += seen * float(rng.uniform(-0.1, 0.1))
    yaw = float(rng.uniform(0, 2 * np.pi)) + direction.turn * smooth
    yaw = yaw + sway(rng, frames, 0.03 * direction.sway, 0.002)
    if leave:
        away = pulse(frames, float(rng.uniform(0.45, 0.65)) * frames, 0.3 * frames)
        side = float(rng.choice([-1, 1])) * leave * seen * away
        aim += side[:, None] * np.stack([np.cos(yaw), -np.sin(yaw)], axis=1)
    return Flight(
        aim=aim,
        distance=far,
        yaw=yaw,
        pitch=direction.pitch + sway(rng, frames, 0.015 * direction.sway, 0.001),
        roll=sway(rng, frames, 0.012 * direction.sway, 0.002),
        focal=_FOCAL * size[0],
        size=size,
    )


def _smoothed(places: Floats, reach: int) -> Floats:
    """A moving mean, the ends carried on straight."""
    steps = np.arange(1, reach + 1)[:, None]
    before = places[0] - steps[::-1] * (places[1] - places[0])
    after = places[-1] + steps * (places[-1] - places[-2])
    padded = np.concatenate([before, places, after])
    kernel = np.ones(2 * reach + 1) / (2 * reach + 1)
    columns = [np.convolve(padded[:, axis], kernel, mode="valid") for axis in (0, 1)]
    return np.stack(columns, axis=1)


def trees_between(
    rng: np.random.Generator, flight: Flight, target: Mover, *, full: bool
) -> list[Tree]:
    """Trees that hide the target for a while, by half or wholly, around the middle.

    Their crowns lie on the lines from the camera to where the target then is.
    """
    frames = len(target.places)
    middle = float(rng.uniform(0.4, 0.6)) * frames
    x_size, _, z_size = target.body.size
    large = 0.5 * float(np.hypot(x_size, z_size))
    moments = np.clip(middle + np.linspace(-0.05, 0.05, 3 if full else 1) * frames, 0, frames - 1)
    trees = []
    for moment in moments.astype(int).tolist():
        eye = np.array(flight.camera(moment).position)
        spot = np.array([*target.places[moment], 0.5 * z_size])
        height = max(3.0, z_size + 0.8) if full else max(2.2, z_size)
        share = (height - spot[2]) / max(eye[2] - spot[2], 1e-6)
        centre = spot + share * (eye - spot)
        radius = large * 1.35 + 0.5 if full else 0.62 * large + 0.2
        aside = 0.0 if full else 0.75 * large
        yaw = float(flight.yaw[moment])
        centre[:2] += aside * np.array([np.cos(yaw), -np.sin(yaw)])
        trees.append(make_tree(rng, float(centre[0]), float(centre[1]), height, radius))
    return trees


PLACES: dict[Kind, tuple[Place, ...]] = {
    "car": ("crossing", "avenue"),
    "van": ("crossing", "avenue"),
    "truck": ("crossing", "avenue"),
    "bus": ("crossing", "avenue"),
    "bike": ("crossing", "avenue", "quay"),
    "person": ("plaza", "avenue"),
    "boat": ("quay",),
}
"""Where each kind of target can be."""
