"""What of the target a frame shows: followed while nearer things are laid over it."""

from dataclasses import dataclass

import numpy as np

from nat2024.night.arrays import Light
from nat2024.night.sprites import Sprite, overlap
from nat2024.types import Box

VISIBLE = 0.1
"""A target of which less is seen counts as absent."""


@dataclass(frozen=True, slots=True)
class Sight:
    """What of the target a frame shows.

    Attributes:
        box: float64 (4,) tight around the part of its mask inside the frame, hidden or not; NaN
            where less than `VISIBLE` of the target can be seen.
        inside: share of its mask that is inside the frame.
        visible: share of its mask that is inside the frame and not hidden.
        light: mean light on the target's place.
    """

    box: Box
    inside: float
    visible: float
    light: float


class Watch:
    """Follows what is left of the target while nearer things are laid over it."""

    def __init__(self, size: tuple[int, int]) -> None:
        self._size = size
        self._target: Sprite | None = None
        self._left: Light | None = None

    def see(self, sprite: Sprite, keep: Light | None, *, is_target: bool) -> None:
        """Take note of a sprite that has just been laid."""
        if is_target:
            self._target = sprite
            self._left = sprite.cover.copy() if keep is None else sprite.cover * keep
        elif self._target is not None and self._left is not None:
            corner = (
                sprite.corner[0] - self._target.corner[0],
                sprite.corner[1] - self._target.corner[1],
            )
            height, width = self._left.shape
            found = overlap(corner, sprite.cover.shape, (width, height))
            if found is not None:
                outer, inner = found
                cover = sprite.cover[inner]
                self._left[outer] *= 1 - (cover if keep is None else cover * keep[inner])

    def sight(self, light: float) -> Sight:
        """What can be seen of it in the end."""
        absent = Sight(np.full(4, np.nan), 0.0, 0.0, light)
        target, left = self._target, self._left
        if target is None or left is None:
            return absent
        found = overlap(target.corner, target.cover.shape, self._size)
        whole = float(target.cover.sum())
        if found is None or whole <= 0:
            return absent
        _, inner = found
        inside = float(target.cover[inner].sum()) / whole
        visible = float(left[inner].sum()) / whole
        box = _tight(target, inner)
        if visible < VISIBLE or box is None:
            return Sight(np.full(4, np.nan), inside, visible, light)
        return Sight(box, inside, visible, light)


def _tight(sprite: Sprite, inner: tuple[slice, slice]) -> Box | None:
    """Bounds of the part of a mask that is inside the frame, in pixels of the frame."""
    n = sprite.samples
    rows, columns = (slice(s.start * n, s.stop * n) for s in inner)
    mask = sprite.mask[rows, columns]
    across, down = np.flatnonzero(mask.any(axis=0)), np.flatnonzero(mask.any(axis=1))
    if not len(across):
        return None
    x0 = sprite.corner[0] + inner[1].start + across[0] / n
    y0 = sprite.corner[1] + inner[0].start + down[0] / n
    return np.array([x0, y0, (across[-1] + 1 - across[0]) / n, (down[-1] + 1 - down[0]) / n])
