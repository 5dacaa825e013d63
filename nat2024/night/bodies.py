"""Things that move: vehicles, boats and people, as solids that any camera can look at.

A body stands at the origin and faces along +x; z is up. Solids are drawn from the lowest to the
highest, which is right for every view from above.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from nat2024.night.arrays import Colour, Points, colour

Kind: TypeAlias = Literal["car", "van", "truck", "bus", "bike", "person", "boat"]
"""What can be a target."""

_GLASS = colour(0.02, 0.02, 0.02)
_SKIN = colour(0.22, 0.27, 0.38)


@dataclass(frozen=True, slots=True)
class Prism:
    """A solid with four sides, perhaps narrower above.

    Attributes:
        length: (back, front) of its foot along x.
        top: (back, front) of its top along x.
        half: half its width at foot and top.
        height: (foot, top) in metres.
        albedo: of its top, BGR.
        sides: of its sides, BGR.
        band: radiance of a band of lit windows round it, 0 for none.
    """

    length: tuple[float, float]
    top: tuple[float, float]
    half: tuple[float, float]
    height: tuple[float, float]
    albedo: Colour
    sides: Colour
    band: float = 0.0

    def corners(self) -> Points:
        """(8, 3): the foot, then the top, each anticlockwise from back right."""
        rows = []
        for (back, front), half, z in (
            (self.length, self.half[0], self.height[0]),
            (self.top, self.half[1], self.height[1]),
        ):
            rows += [(back, -half, z), (front, -half, z), (front, half, z), (back, half, z)]
        return np.array(rows, dtype=np.float64)


@dataclass(frozen=True, slots=True)
class Limb:
    """A rounded bar from one point to another: a leg, a trunk, a head.

    Attributes:
        start: one end in metres.
        end: the other.
        width: across in metres.
        albedo: BGR.
    """

    start: tuple[float, float, float]
    end: tuple[float, float, float]
    width: float
    albedo: Colour


@dataclass(frozen=True, slots=True)
class Lantern:
    """A small light on a body.

    Attributes:
        position: in metres.
        radius: of the light in metres.
        radiance: BGR.
        facing: 1 seen from the front, -1 from behind, 0 from everywhere.
    """

    position: tuple[float, float, float]
    radius: float
    radiance: Colour
    facing: int


@dataclass(frozen=True, slots=True)
class Body:
    """A thing of one kind.

    Attributes:
        kind: what it is.
        size: (length, width, height) in metres.
        prisms: its solids.
        lanterns: its lights.
        beam: strength of its head lights on the ground, 0 for none.
        gait: limbs of a walker at a phase of its step in radians; None for what does not walk.
    """

    kind: Kind
    size: tuple[float, float, float]
    prisms: tuple[Prism, ...] = ()
    lanterns: tuple[Lantern, ...] = ()
    beam: float = 0.0
    gait: Callable[[float], tuple[Limb, ...]] | None = None

    def limbs(self, phase: float) -> tuple[Limb, ...]:
        """Limbs at a phase of the step."""
        return self.gait(phase) if self.gait else ()


def make_body(rng: np.random.Generator, kind: Kind, *, lights: bool = True) -> Body:
    """A body of a kind, its size and colours by chance.

    Args:
        rng: where chance comes from.
        kind: what it is.
        lights: whether its lights are on.
    """
    if kind == "person":
        return _person(rng)
    if kind == "bike":
        return _bike(rng, lights)
    if kind == "boat":
        return _boat(rng)
    return _vehicle(rng, kind, lights)


_SIZES: dict[str, tuple[float, float, float]] = {
    "car": (4.5, 1.85, 1.5),
    "van": (5.2, 2.0, 2.1),
    "truck": (8.5, 2.5, 3.3),
    "bus": (11.5, 2.55, 3.1),
}


def _paint(rng: np.random.Generator) -> Colour:
    """White, silver, grey, black, or a colour."""
    kind = rng.random()
    if kind < 0.4:
        return colour(1, 1, 1) * np.float32(rng.uniform(0.55, 0.8))
    if kind < 0.75:
        return colour(1, 1, 1) * np.float32(rng.uniform(0.05, 0.35))
    grey = float(rng.uniform(0.05, 0.3))
    return np.asarray(0.6 * grey + 0.4 * rng.uniform(0.02, 0.5, size=3), dtype=np.float32)


def _vehicle(rng: np.random.Generator, kind: Kind, lights: bool) -> Body:
    length, width, height = (s * float(rng.uniform(0.94, 1.06)) for s in _SIZES[kind])
    back, front, half = -length / 2, length / 2, width / 2
    paint = _paint(rng)
    dark = paint * np.float32(0.45)
    if kind == "car":
        waist = 0.58 * height
        prisms = [
            Prism((back, front), (back, front), (half, half), (0.2, waist), paint, dark),
            Prism(
                (back + 0.1 * length, front - 0.25 * length),
                (back + 0.25 * length, front - 0.45 * length),
                (half * 0.95, half * 0.78),
                (waist, height),
                paint,
                _GLASS,
            ),
        ]
    elif kind == "truck":
        cab = front - 0.25 * length
        load = _paint(rng)
        half_load = half * 0.98
        prisms = [
            Prism(
                (back, cab - 0.2), (back, cab - 0.2), (half_load,) * 2, (0.6, height), load, load
            ),
            Prism((cab, front), (cab, front - 0.3), (half, half), (0.4, 2.5), paint, dark),
        ]
    else:
        band = float(rng.uniform(0.1, 0.5)) if kind == "bus" and lights else 0.0
        shape = (back, front), (back + 0.1, front - 0.15), (half, half * 0.94)
        prisms = [
            Prism(*shape, (0.3, height), paint, dark, band),
            Prism(
                (back + 0.3 * length, back + 0.5 * length),
                (back + 0.3 * length, back + 0.5 * length),
                (half * 0.5,) * 2,
                (height, height + 0.2),
                dark,
                dark,
            ),
        ]
    return Body(
        kind,
        (length, width, height),
        tuple(prisms),
        _car_lights(rng, length, half) if lights else (),
        beam=float(rng.uniform(0.25, 0.9)) if lights else 0.0,
    )


def _car_lights(rng: np.random.Generator, length: float, half: float) -> tuple[Lantern, ...]:
    white = colour(0.85, 0.95, 1.0) * np.float32(rng.uniform(5, 25))
    red = colour(0.1, 0.08, 1.0) * np.float32(rng.uniform(1.0, 4.0))
    across = half * 0.75
    front, back = length / 2 + 0.02, -length / 2 - 0.02
    lights = [Lantern((front, y, 0.65), 0.11, white, 1) for y in (-across, across)]
    lights += [Lantern((back, y, 0.8), 0.1, red, -1) for y in (-across, across)]
    return tuple(lights)


def _walker(
    rng: np.random.Generator, height: float, seat: float = 0.0
) -> Callable[[float], tuple[Limb, ...]]:
    coat, legs, hair = _paint(rng) * np.float32(0.7), _paint(rng) * np.float32(0.4), _GLASS
    skin = _SKIN * np.float32(rng.uniform(0.5, 1.2))

    def limbs(phase: float) -> tuple[Limb, ...]:
        hip, shoulder = 0.5 * height + seat, 0.8 * height + seat
        swing = 0.22 * height * np.sin(phase)
        parts = []
        for sign in (-1, 1):
            foot = (sign * swing, 0.1 * sign, 0.04 + seat)
            hand = (-sign * swing * 0.7, 0.25 * sign, hip)
            parts.append(Limb(foot, (0.0, 0.09 * sign, hip), 0.16, legs))
            parts.append(Limb(hand, (0.0, 0.22 * sign, shoulder), 0.11, coat))
        parts.append(Limb((0, 0, hip), (0, 0, shoulder - 0.05), 0.42, coat))
        parts.append(
            Limb((0.02, 0, 0.87 * height + seat), (0.02, 0, 0.9 * height + seat), 0.2, skin)
        )
        parts.append(Limb((0, 0, 0.93 * height + seat), (0, 0, 0.94 * height + seat), 0.2, hair))
        return tuple(parts)

    return limbs


def _person(rng: np.random.Generator) -> Body:
    height = float(rng.uniform(1.6, 1.85))
    return Body("person", (0.5, 0.5, height), gait=_walker(rng, height))


def _bike(rng: np.random.Generator, lights: bool) -> Body:
    rider = _walker(rng, 1.3, seat=0.45)
    metal = _paint(rng) * np.float32(0.6)

    def limbs(phase: float) -> tuple[Limb, ...]:
        frame = (
            Limb((-0.95, 0, 0.32), (-0.45, 0, 0.32), 0.5, _GLASS),
            Limb((0.45, 0, 0.32), (0.95, 0, 0.32), 0.5, _GLASS),
            Limb((-0.6, 0, 0.65), (0.55, 0, 0.7), 0.34, metal),
            Limb((0.55, -0.35, 1.0), (0.55, 0.35, 1.0), 0.1, metal),
        )
        return (*frame, *rider(0.5 * np.sin(phase)))

    lanterns: tuple[Lantern, ...] = ()
    if lights:
        white = colour(0.9, 0.95, 1.0) * np.float32(rng.uniform(4, 15))
        red = colour(0.1, 0.08, 1.0) * np.float32(rng.uniform(1, 3))
        lanterns = (Lantern((1.0, 0, 0.8), 0.09, white, 1), Lantern((-1.0, 0, 0.7), 0.07, red, -1))
    return Body("bike", (1.9, 0.7, 1.75), (), lanterns, beam=0.3 if lights else 0.0, gait=limbs)


def _boat(rng: np.random.Generator) -> Body:
    length, half = float(rng.uniform(9, 14)), float(rng.uniform(1.5, 2.1))
    hull, deck = _paint(rng), colour(0.2, 0.25, 0.3)
    back, front = -length / 2, length / 2
    lit = float(rng.uniform(0.15, 0.6))
    prisms = (
        Prism((back, front - 2.5), (back - 0.2, front - 2), (half, half), (0, 0.9), deck, hull),
        Prism((front - 2.6, front), (front - 2.1, front), (half, 0.3), (0, 1.0), deck, hull),
        Prism(
            (back + 1.0, front - 3.5),
            (back + 1.2, front - 3.9),
            (half * 0.75, half * 0.7),
            (0.9, 2.8),
            colour(0.5, 0.52, 0.55),
            hull,
            lit,
        ),
    )
    lanterns = (
        Lantern((front - 0.5, 0, 1.8), 0.1, colour(0.2, 1.0, 0.3) * np.float32(6), 0),
        Lantern((back + 1.0, 0, 3.4), 0.12, colour(0.8, 0.95, 1.0) * np.float32(12), 0),
    )
    return Body("boat", (length, 2 * half, 2.8), prisms, lanterns)
