"""The ground seen from straight above: roads, pavement, grass, water, photographs, as albedo.

A plan is a square picture of the ground, `side` metres wide, centred on the origin of the world;
its rows run along y. Everything painted keeps hard edges: they are what night video has where lit
things end.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from nat2024.night.arrays import Colour, Light, Points, colour, smooth_noise
from nat2024.types import Floats, Image

Place: TypeAlias = Literal["crossing", "avenue", "plaza", "quay"]
"""Kinds of places: two roads that cross, one road with trees, a paved square, a river bank."""

PIXELS = 1536
"""Width of a plan in pixels."""

_ASPHALT = colour(0.10, 0.105, 0.11)
_PAVEMENT = colour(0.20, 0.225, 0.24)
_GRASS = colour(0.03, 0.075, 0.06)
_EARTH = colour(0.07, 0.10, 0.13)
_WATER = colour(0.03, 0.028, 0.022)
_PAINT = colour(0.55, 0.6, 0.62)
_KERB = colour(0.36, 0.38, 0.4)


@dataclass(frozen=True, slots=True)
class Road:
    """A straight road through the whole plan.

    Attributes:
        along_y: whether it runs along y, else along x.
        centre: of the road on the other axis, in metres.
        half: half its width in metres.
        lanes: lanes each way.
    """

    along_y: bool
    centre: float
    half: float
    lanes: int

    def lane(self, number: int) -> tuple[float, int]:
        """Offset of a lane from the world's axis, and the direction of its traffic (1 or -1).

        Lanes count from -`lanes` to `lanes` - 1; traffic keeps to the right.
        """
        width = self.half / self.lanes
        offset = (number + 0.5) * width
        forward = (offset > 0) == self.along_y
        return self.centre + offset, 1 if forward else -1


@dataclass(frozen=True, slots=True)
class Plan:
    """The ground of a scene.

    Attributes:
        place: what kind of place it is.
        side: metres across.
        albedo: float32 (PIXELS, PIXELS, 3) BGR, the share of light that comes back.
        roads: through it.
        square: (x0, y0, x1, y1) of the paved square, in metres, where there is one.
        bank: x in metres where the water begins, where there is water.
    """

    place: Place
    side: float
    albedo: Light
    roads: tuple[Road, ...]
    square: tuple[float, float, float, float] | None = None
    bank: float | None = None

    def to_pixels(self, points: Points) -> Points:
        """From metres to plan pixels, the centre of the first at 0.5."""
        return (np.asarray(points)[..., :2] + self.side / 2) * (PIXELS / self.side)


def make_plan(
    rng: np.random.Generator, place: Place, side: float, photographs: Sequence[Light] = ()
) -> Plan:
    """Lay out and paint the ground of a place.

    Args:
        rng: where chance comes from.
        place: what kind of place.
        side: metres across.
        photographs: reflectance of photographs, float32 (H, W, 3) BGR, that cover the blocks
            between the roads; empty for painted ground only.
    """
    painter = _Painter(rng, side)
    roads = _roads(rng, place)
    square = None
    bank = None
    painter.fill(_GRASS if rng.random() < 0.6 else _EARTH)
    painter.grain(0.35)
    _paint_blocks(painter, roads, side, photographs)
    if place == "plaza":
        square = _paint_square(painter, side)
    if place == "quay":
        bank = float(rng.uniform(1.0, 3.0))
        _paint_water(painter, bank, side)
    for road in roads:
        painter.stripe(road, road.half + 4.0, _PAVEMENT)
    for road in roads:
        painter.stripe(road, road.half + 0.25, _KERB)
    for road in roads:
        painter.stripe(road, road.half, _ASPHALT * np.float32(rng.uniform(0.8, 1.25)))
    painter.grain(0.14)
    _paint_markings(painter, roads, side)
    return Plan(place, side, painter.finish(), roads, square, bank)


def _roads(rng: np.random.Generator, place: Place) -> tuple[Road, ...]:
    lanes = int(rng.integers(2, 4))
    half = lanes * 3.4
    if place == "crossing":
        other = int(rng.integers(1, 4))
        return Road(True, 0.0, half, lanes), Road(False, 0.0, other * 3.4, other)
    if place == "avenue":
        return (Road(True, 0.0, half, lanes),)
    if place == "quay":
        return (Road(True, -12.0, 6.8, 2),)
    return ()


class _Painter:
    """A plan while it is being painted."""

    def __init__(self, rng: np.random.Generator, side: float) -> None:
        self.rng = rng
        self.side = side
        self.scale = PIXELS / side
        self.albedo = np.zeros((PIXELS, PIXELS, 3), dtype=np.float32)

    def fill(self, tint: Colour) -> None:
        self.albedo[:] = tint

    def grain(self, strength: float) -> None:
        """Make everything so far uneven on several scales."""
        field = np.zeros((PIXELS, PIXELS), dtype=np.float32)
        for scale, share in ((160, 0.5), (24, 0.35), (6, 0.4), (2, 0.3)):
            field += np.float32(share) * smooth_noise(self.rng, (PIXELS, PIXELS), scale)
        self.albedo *= np.exp(np.float32(strength) * field)[..., None]

    def polygon(self, points: Floats, tint: Colour | float) -> None:
        """Fill a polygon given in metres, with soft edges of a fraction of a pixel."""
        import cv2

        fine = np.rint(((np.asarray(points) + self.side / 2) * self.scale - 0.5) * 16)
        value = np.broadcast_to(np.asarray(tint, dtype=np.float64), 3).tolist()
        cv2.fillPoly(self.albedo, [fine.astype(np.int32)], value, cv2.LINE_8, 4)

    def rectangle(self, x0: float, y0: float, x1: float, y1: float, tint: Colour | float) -> None:
        """Fill a rectangle given in metres."""
        self.polygon(np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]]), tint)

    def across(
        self, road: Road, start: float, end: float, low: float, high: float, tint: Colour
    ) -> None:
        """Fill from `start` to `end` along a road, from `low` to `high` across it."""
        low, high = low + road.centre, high + road.centre
        if road.along_y:
            self.rectangle(low, start, high, end, tint)
        else:
            self.rectangle(start, low, end, high, tint)

    def stripe(self, road: Road, half: float, tint: Colour) -> None:
        """Fill a road over its whole length."""
        self.across(road, -self.side, self.side, -half, half, tint)

    def patch(self, box: tuple[float, float, float, float], picture: Light) -> None:
        """Cover a rectangle with a picture, mirrored where it repeats."""
        import cv2

        corners = (np.array(box) + self.side / 2) * self.scale
        x0, y0, x1, y1 = np.clip(np.rint(corners), 0, PIXELS).astype(int)
        if x1 - x0 < 2 or y1 - y0 < 2:
            return
        self.albedo[y0:y1, x0:x1] = cv2.resize(
            picture, (int(x1 - x0), int(y1 - y0)), interpolation=cv2.INTER_LINEAR
        )

    def finish(self) -> Light:
        return np.clip(self.albedo, 0.004, 0.85)


def _paint_blocks(
    painter: _Painter, roads: Sequence[Road], side: float, photographs: Sequence[Light]
) -> None:
    """What lies between the roads: photographs where given, else lots, yards and roofs."""
    rng = painter.rng
    if photographs:
        step = side / 3
        for x in np.arange(-side / 2, side / 2, step):
            for y in np.arange(-side / 2, side / 2, step):
                picture = photographs[int(rng.integers(len(photographs)))]
                painter.patch((x, y, x + step, y + step), picture * np.float32(0.6))
        return
    for _ in range(26):
        x, y = rng.uniform(-side / 2, side / 2, size=2)
        width, depth = rng.uniform(0.04, 0.16, size=2) * side
        tint = (_PAVEMENT, _EARTH, _GRASS, _ASPHALT)[int(rng.integers(4))]
        angle = 0.0 if roads else float(rng.uniform(0, np.pi))
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        corners = np.array([[0, 0], [width, 0], [width, depth], [0, depth]]) @ turn.T + (x, y)
        painter.polygon(corners, tint * np.float32(rng.uniform(0.6, 1.3)))


def _paint_square(painter: _Painter, side: float) -> tuple[float, float, float, float]:
    """A paved square with joints between its slabs, and bands of other stone."""
    rng = painter.rng
    half_width, half_depth = (float(v) for v in rng.uniform(0.26, 0.4, size=2) * side)
    box = (-half_width, -half_depth, half_width, half_depth)
    slab = float(rng.uniform(1.2, 2.6))
    painter.rectangle(*_grown(box, 0.35), _KERB)
    painter.rectangle(*box, _PAVEMENT)
    for x in np.arange(-half_width, half_width, slab):
        for y in np.arange(-half_depth, half_depth, slab):
            shade = np.float32(rng.uniform(0.82, 1.12))
            painter.rectangle(x, y, x + slab, y + slab, _PAVEMENT * shade)
    joint = _PAVEMENT * np.float32(0.5)
    for x in np.arange(-half_width, half_width, 2 * slab):
        painter.rectangle(x, -half_depth, x + 0.08, half_depth, joint)
    for y in np.arange(-half_depth, half_depth, 2 * slab):
        painter.rectangle(-half_width, y, half_width, y + 0.08, joint)
    for _ in range(3):
        y = float(rng.uniform(-half_depth, half_depth))
        painter.rectangle(-half_width, y, half_width, y + 0.5, _PAINT * np.float32(0.75))
    return box


def _grown(box: tuple[float, float, float, float], by: float) -> tuple[float, float, float, float]:
    return box[0] - by, box[1] - by, box[2] + by, box[3] + by


def _paint_water(painter: _Painter, bank: float, side: float) -> None:
    """A river with its ripples on one side, and the stone edge of the quay."""
    import cv2

    painter.rectangle(bank, -side, side, side, _WATER)
    left = int((bank + side / 2) * painter.scale)
    ripples = smooth_noise(painter.rng, (PIXELS, PIXELS // 5 + 1), 4)
    stretched = cv2.resize(ripples, (PIXELS, PIXELS), interpolation=cv2.INTER_LINEAR)
    painter.albedo[:, left:] *= np.exp(np.float32(0.5) * stretched)[:, left:, None]
    painter.rectangle(bank - 5.0, -side, bank, side, _PAVEMENT)
    painter.rectangle(bank - 0.5, -side, bank, side, _KERB)


def _paint_markings(painter: _Painter, roads: Sequence[Road], side: float) -> None:
    """Lines between lanes, double lines in the middle, stop lines and zebra crossings."""
    rng = painter.rng
    for number, road in enumerate(roads):
        gap = max((other.half for other in roads if other is not road), default=0.0)
        stop = gap + 7.0 if gap else 0.0
        ends = ((-side / 2, -stop), (stop, side / 2)) if gap else ((-side / 2, side / 2),)
        paint = _PAINT * np.float32(rng.uniform(0.6, 1.0))
        for start, end in ends:
            _paint_lines(painter, road, start, end, paint)
        if gap:
            for sign in (-1, 1):
                _paint_zebra(painter, road, sign * (gap + 1.5), sign * (gap + 5.0), paint)
                low, high = sorted((sign * (gap + 6.0), sign * (gap + 6.4)))
                painter.across(road, low, high, -road.half, road.half, paint)
        elif number == 0 and rng.random() < 0.8:
            place = float(rng.uniform(-0.2, 0.2) * side)
            _paint_zebra(painter, road, place, place + 3.5, paint)


def _paint_lines(painter: _Painter, road: Road, start: float, end: float, paint: Colour) -> None:
    width = road.half / road.lanes
    for offset in (-0.22, 0.1):
        painter.across(road, start, end, offset, offset + 0.14, paint)
    for side_offset in (-road.half + 0.4, road.half - 0.55):
        painter.across(road, start, end, side_offset, side_offset + 0.15, paint)
    for lane in range(1, road.lanes):
        for offset in (-lane * width, lane * width):
            for place in np.arange(start, end - 2.0, 6.0):
                painter.across(road, place, place + 2.4, offset - 0.08, offset + 0.08, paint)


def _paint_zebra(painter: _Painter, road: Road, start: float, end: float, paint: Colour) -> None:
    start, end = sorted((start, end))
    for offset in np.arange(-road.half + 0.3, road.half - 0.3, 1.0):
        painter.across(road, start, end, offset, offset + 0.5, paint)


def reflectance(photograph: Image, rng: np.random.Generator) -> Light:
    """What a daytime photograph says about albedo: its light, scaled to a 99th percentile of 0.8.

    Args:
        photograph: uint8 (H, W, 3) BGR.
        rng: chooses the power 0.85..1.1 that contrast is changed by.
    """
    light = (photograph.astype(np.float32) / np.float32(255)) ** np.float32(2.2)
    top = float(np.percentile(light.mean(axis=2)[::4, ::4], 99))
    scaled = np.clip(light * np.float32(0.8 / max(top, 1e-4)), 0, 1)
    return np.asarray(scaled ** np.float32(rng.uniform(0.85, 1.1)), dtype=np.float32)
