"""Night sequences from nothing: settings in, frames with exact ground truth out."""

import copy
from collections import deque
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from nat2024.errors import UsageError
from nat2024.night.arrays import Light, log_uniform
from nat2024.night.bodies import Kind, make_body
from nat2024.night.direction import (
    PLACES,
    draw_direction,
    first_distance,
    flight_over,
    target_way,
    trees_between,
    world_side,
)
from nat2024.night.ground import Place, make_plan
from nat2024.night.painting import paint
from nat2024.night.scene import Scene, build_scene
from nat2024.night.sensor import Development, draw_sensor, expose
from nat2024.night.sight import VISIBLE, Sight
from nat2024.types import Box, Boxes, Flags, Floats, Image

Occlusion: TypeAlias = Literal["none", "partial", "full"]

KINDS: tuple[Kind, ...] = ("car", "person", "bus", "bike", "truck", "boat", "van")
"""Targets in the order in which sequences of a dataset take them."""

_MEAN = (0.055, 0.105)
"""Mean grey levels 0..1 that sequences are exposed to where none is asked for."""


@dataclass(frozen=True, slots=True)
class NightSettings:
    """Settings of one sequence; what is None is left to chance.

    Attributes:
        target: what is tracked.
        frames: number of frames.
        size: (width, height) in pixels.
        seed: what all chance follows from.
        place: where it is.
        occlusion: whether trees hide the target for a while.
        out_of_view: whether the view leaves it for a while.
        mean: mean grey level 0..1 of the first, middle and last frame.
        others: about how many people and boats there are beside it.
        photographs: reflectance of photographs, float32 (H, W, 3) BGR, see `reflectance`; they
            cover the blocks between the roads and the walls.
    """

    target: Kind = "car"
    frames: int = 90
    size: tuple[int, int] = (640, 360)
    seed: int = 0
    place: Place | None = None
    occlusion: Occlusion = "none"
    out_of_view: bool = False
    mean: float | None = None
    others: int = 8
    photographs: tuple[Light, ...] = ()


@dataclass(frozen=True, slots=True)
class NightFrame:
    """One rendered frame.

    Attributes:
        image: uint8 (H, W, 3) BGR, as the sensor gives it, before JPEG.
        box: float64 (4,) x, y, w, h: tight around the part of the target's mask inside the frame,
            whether hidden or not; NaN where less than a tenth of the target is seen.
        visible: share 0..1 of the target that is inside the frame and not hidden.
        inside: share 0..1 of the target that is inside the frame.
        light: mean irradiance at the target's place, 1 being that under a usual lamp.
    """

    image: Image
    box: Box
    visible: float
    inside: float
    light: float


class NightSequence:
    """A night sequence; frames are rendered when they are asked for, in any order.

    Example:
        >>> from nat2024.night import NightSequence, NightSettings
        >>> sequence = NightSequence(NightSettings("person", frames=3, size=(160, 90), seed=4))
        >>> sequence.frame(0).image.shape
        (90, 160, 3)
    """

    def __init__(self, settings: NightSettings) -> None:
        """Lay out the scene and expose it.

        Raises:
            UsageError: a setting is out of range, or the target cannot be at the place.
        """
        _check(settings)
        self.settings = settings
        rng = np.random.default_rng([settings.seed, 2024])
        self.scene = _compose(rng, settings)
        sensor = draw_sensor(rng)
        chosen = log_uniform(rng, *_MEAN)
        self.mean = chosen if settings.mean is None else settings.mean
        self.sensor = expose(sensor, _samples(self.scene, settings.frames), self.mean)
        self._development = Development(self.sensor, settings.size, settings.seed)

    def __len__(self) -> int:
        """Number of frames."""
        return self.settings.frames

    def frame(self, index: int) -> NightFrame:
        """Render frame `index` (0-based); always the same for the same settings."""
        light, sight = paint(self.scene, index)
        image = self._development.develop(light, index)
        return NightFrame(image, sight.box, sight.visible, sight.inside, sight.light)

    def __iter__(self) -> Iterator[NightFrame]:
        """All frames in order; one is developed while the next is painted."""
        with ThreadPoolExecutor(1) as pool:
            waiting: deque[tuple[Future[Image], Sight]] = deque()
            for index in range(len(self)):
                light, sight = paint(self.scene, index)
                waiting.append((pool.submit(self._development.develop, light, index), sight))
                if len(waiting) > 2:
                    yield _joined(*waiting.popleft())
            while waiting:
                yield _joined(*waiting.popleft())


def _joined(image: "Future[Image]", sight: Sight) -> NightFrame:
    return NightFrame(image.result(), sight.box, sight.visible, sight.inside, sight.light)


def _check(settings: NightSettings) -> None:
    msg = ""
    if settings.target not in PLACES:
        msg = f"no target {settings.target!r}: {', '.join(PLACES)}"
    elif settings.place is not None and settings.place not in PLACES[settings.target]:
        where = ", ".join(PLACES[settings.target])
        msg = f"a {settings.target} cannot be at a {settings.place}: {where}"
    elif settings.frames < 2:
        msg = f"{settings.frames} frames are no sequence: 2 at least"
    elif not all(64 <= side <= 4096 for side in settings.size):
        msg = f"frame size {settings.size} is not within 64 to 4096 pixels a side"
    elif settings.mean is not None and not 0.03 <= settings.mean <= 0.5:
        msg = f"mean grey level {settings.mean} is not within 0.03 to 0.5"
    if msg:
        raise UsageError(msg)


def _compose(rng: np.random.Generator, settings: NightSettings) -> Scene:
    kind = settings.target
    places = PLACES[kind]
    place = settings.place or places[int(rng.integers(len(places)))]
    direction = draw_direction(rng, kind)
    body = make_body(rng, kind)
    distance = first_distance(direction, body)
    plan = make_plan(rng, place, world_side(direction, distance), settings.photographs)
    target = target_way(rng, plan, body, settings.frames)
    leave = 1.15 if settings.out_of_view else 0.0
    flight = flight_over(rng, target, direction, distance, settings.size, leave)
    trees = []
    if settings.occlusion != "none":
        trees = trees_between(rng, flight, target, full=settings.occlusion == "full")
    before = copy.deepcopy(rng)
    scene = build_scene(rng, plan, flight, target, trees, settings.others, settings.photographs)
    if trees and paint(scene, 0)[1].visible < VISIBLE:
        # In a few frames a target hardly moves on: what hides it in the middle hides its start.
        return build_scene(before, plan, flight, target, [], settings.others, settings.photographs)
    return scene


def _samples(scene: Scene, frames: int) -> list[Light]:
    import cv2

    found = []
    for index in sorted({0, frames // 2, frames - 1}):
        light, _ = paint(scene, index)
        size = (max(1, light.shape[1] // 2), max(1, light.shape[0] // 2))
        small = cv2.resize(light, size, interpolation=cv2.INTER_AREA)
        found.append(np.asarray(small, dtype=np.float32))
    return found


@dataclass(frozen=True, slots=True)
class Truth:
    """Ground truth of a whole sequence.

    Attributes:
        boxes: float64 (n, 4).
        visible: float64 (n,), share of the target that is seen.
        inside: float64 (n,), share of the target that is inside the frame.
        light: float64 (n,), light at the target's place.
    """

    boxes: Boxes
    visible: Floats
    inside: Floats
    light: Floats

    @classmethod
    def of(cls, frames: list[NightFrame]) -> "Truth":
        """Collect it from frames, whose images may be dropped."""
        return cls(
            np.stack([frame.box for frame in frames]),
            np.array([frame.visible for frame in frames]),
            np.array([frame.inside for frame in frames]),
            np.array([frame.light for frame in frames]),
        )


ATTRIBUTES = ("ARC", "FM", "FOC", "IV", "LR", "OV", "POC", "SV")
"""Attributes that the renderer knows, in the order of the columns of `att/NAME.txt`."""


def attributes(truth: Truth) -> frozenset[str]:
    """Attributes of a rendered sequence.

    FOC: in some frame nothing of the target is seen though a part is inside the frame. POC: less
    than 90 % of what is inside is seen, and something is. OV: some part leaves the frame. IV: the
    light on the target changes by a factor of 2.5 or more. FM, LR, SV, ARC by the rules of UAV123:
    a step of more than 20 pixels, an area under 400, an area or a shape twice or half the first.
    """
    return frozenset(_from_construction(truth)) | frozenset(_from_boxes(truth.boxes))


def _from_construction(truth: Truth) -> Iterator[str]:
    there = truth.inside > 0.25
    seen = truth.visible / np.maximum(truth.inside, 1e-9)
    if (seen[there] < VISIBLE).any():
        yield "FOC"
    if ((seen[there] < 0.9) & (seen[there] >= VISIBLE)).any():
        yield "POC"
    if (truth.inside < 0.95).any():
        yield "OV"
    lit = truth.light[truth.visible >= VISIBLE]
    if len(lit) and lit.max() >= 2.5 * lit.min():
        yield "IV"


def _from_boxes(boxes: Boxes) -> Iterator[str]:
    present: Flags = np.asarray(np.isfinite(boxes).all(axis=1))
    area, shape = boxes[:, 2] * boxes[:, 3], boxes[:, 2] / boxes[:, 3]
    both = present[1:] & present[:-1]
    centres = boxes[:, :2] + boxes[:, 2:] / 2
    steps = np.linalg.norm(np.diff(centres, axis=0), axis=1)[both]
    if (steps > 20).any():
        yield "FM"
    if (area[present] < 400).any():
        yield "LR"
    for name, values in (("SV", area), ("ARC", shape)):
        seen = values[present]
        if len(seen) and (seen.min() < 0.5 * seen[0] or seen.max() > 2 * seen[0]):
            yield name
