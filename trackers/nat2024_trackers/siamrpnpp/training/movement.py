"""How a target moves between the template and the search crop of a pair."""

from dataclasses import dataclass

import numpy as np

from nat2024.types import Floats
from nat2024_trackers.siamrpnpp.training.geometry import Rng, linear_map


@dataclass(frozen=True, slots=True)
class Ranges:
    """How far targets move and change.

    Attributes:
        search: side of the search crop in pixels; any that is 127 plus a multiple of 8.
        shift: largest displacement from the crop's centre, in crop pixels, on each axis.
        scale: largest |log| of the ratio between true size and the size that the crop assumes.
            Narrow ranges teach a network to repeat the assumed size instead of measuring.
        aspect: largest |log| of the change of shape.
        turn: standard deviation of the rotation in radians.
    """

    search: int = 191
    shift: float = 32.0
    scale: float = 0.6
    aspect: float = 0.3
    turn: float = 0.12


@dataclass(frozen=True, slots=True)
class Move:
    """From template to search crop.

    Attributes:
        linear: float64 (2, 2).
        shift: float64 (2,), displacement from the crop's centre in crop pixels.
        scale: what sizes are multiplied by.
    """

    linear: Floats
    shift: Floats
    scale: float


def draw_shift(rng: Rng, ranges: Ranges) -> Floats:
    """Mostly uniform, else near the centre, where targets usually are."""
    reach = ranges.shift
    near = np.clip(rng.normal(0, reach / 3, size=2), -reach, reach)
    return np.where(rng.random(2) < 0.4, near, rng.uniform(-reach, reach, size=2))


def draw_scale(rng: Rng, ranges: Ranges) -> float:
    """Log-uniform."""
    return float(np.exp(rng.uniform(-ranges.scale, ranges.scale)))


def draw_move(rng: Rng, ranges: Ranges, *, turns: bool = False) -> Move:
    """Displacement, scale, change of shape, rotation and shear; `turns` allows large rotations.

    Seen from above cars turn by right angles, and their tight box with them.
    """
    scale = draw_scale(rng, ranges)
    stretch = float(np.exp(rng.uniform(-ranges.aspect, ranges.aspect) / 2))
    wide = turns and rng.random() < 0.3
    linear = linear_map(
        width=scale * stretch,
        height=scale / stretch,
        angle=float(rng.normal(0, 0.7 if wide else ranges.turn)),
        shear=float(rng.normal(0, 0.06)),
    )
    return Move(linear, draw_shift(rng, ranges), scale)
