"""Objects of training pairs: cut out or drawn, of one part or two, laid on a ground."""

from dataclasses import dataclass, replace

import cv2
import numpy as np

from nat2024.types import Floats, Image
from nat2024_trackers.siamrpnpp.training.geometry import Rng, linear_map, placed, tight_box, warp
from nat2024_trackers.siamrpnpp.training.shapes import SIDE, draw_mask
from nat2024_trackers.siamrpnpp.training.textures import (
    Photographs,
    photograph_texture,
    procedural_texture,
)

_CORNERS = np.array([[0.0, 0], [SIDE, 0], [0, SIDE], [SIDE, SIDE]])
"""Of the canvas of an object."""


@dataclass(frozen=True, slots=True)
class Cut:
    """An object to lay on a background.

    Attributes:
        texture: uint8 (96, 96, 3).
        mask: uint8 (96, 96), its shape.
        opacity: 0..1.
        softness: Gaussian blur of its edge in crop pixels, 0 for a sharp edge.
    """

    texture: Image
    mask: Image
    opacity: float = 1.0
    softness: float = 0.0


Placed = tuple[Cut, Floats]
"""An object and the map from its canvas to a crop."""


def draw_cut(rng: Rng, photographs: Photographs, *, procedural: bool) -> Cut:
    """An object of one part; `procedural` for a drawn surface, else mostly of a photograph."""
    is_drawn = procedural or rng.random() < 0.1
    texture = procedural_texture(rng) if is_drawn else photograph_texture(rng, photographs)
    softness = float(rng.uniform(0.6, 2)) if rng.random() < 0.5 else 0.0
    opacity = float(rng.uniform(0.6, 1)) if rng.random() < 0.1 else 1.0
    return Cut(texture, draw_mask(rng), opacity, softness)


def draw_target(rng: Rng, photographs: Photographs, *, procedural: bool) -> tuple[Cut, Cut]:
    """An object, and the same one later; a third are of two parts, one of which has moved.

    Riders on bikes, surfers on boards, people with legs: real targets are seldom one stiff shape.
    """
    cut = draw_cut(rng, photographs, procedural=procedural)
    if rng.random() >= 0.33:
        return cut, cut
    other = draw_cut(rng, photographs, procedural=procedural)
    places = [_within(rng, rng.uniform(0.55, 0.85)), _within(rng, rng.uniform(0.3, 0.6))]
    moved = places[1].copy()
    turn = linear_map(angle=float(rng.normal(0, 0.35)))
    moved[:, :2] = turn @ moved[:, :2]
    moved[:, 2] += (places[1] - moved) @ np.array([SIDE / 2, SIDE / 2, 1]) + rng.normal(0, 6, 2)
    first, later = (_joined(cut, other, (places[0], place)) for place in (places[1], moved))
    return first, later


def _within(rng: Rng, size: float) -> Floats:
    """A place inside the canvas for a part of this share of its side."""
    margin = SIDE * size / 2
    middle = rng.uniform(margin, SIDE - margin, size=2)
    stretch = float(np.exp(rng.uniform(-0.4, 0.4)))
    linear = linear_map(width=size * min(stretch, 1), height=size * min(1 / stretch, 1))
    return placed(linear, np.full(2, SIDE / 2), middle)


def _joined(cut: Cut, other: Cut, places: tuple[Floats, Floats]) -> Cut:
    """One object of two; the second lies on the first."""
    masks = [
        warp(one.mask, place, SIDE, border=cv2.BORDER_CONSTANT)
        for one, place in zip((cut, other), places, strict=True)
    ]
    textures = [
        warp(one.texture, place, SIDE, border=cv2.BORDER_REPLICATE)
        for one, place in zip((cut, other), places, strict=True)
    ]
    texture = np.where(masks[1][..., None] > 127, textures[1], textures[0])
    mask = np.where(np.maximum(*masks) > 127, 255, 0).astype(np.uint8)
    return replace(cut, texture=texture, mask=mask)


def brightened(rng: Rng, cut: Cut) -> Cut:
    """The same object in other light, in half of the pairs."""
    if rng.random() >= 0.5:
        return cut
    gain = float(np.exp(rng.uniform(-0.6, 0.4)))
    texture = np.clip(cut.texture * np.float32(gain), 0, 255).astype(np.uint8)
    return replace(cut, texture=texture)


def lay(ground: Image, cut: Cut, place: Floats) -> Image:
    """The ground with an object on it."""
    corner, size = _part(ground, place, 2 + 3 * cut.softness)
    if size < 1:
        return ground
    local = place.copy()
    local[:, 2] -= corner
    mask = warp(cut.mask, local, size, border=cv2.BORDER_CONSTANT)
    if cut.softness:
        mask = np.asarray(cv2.GaussianBlur(mask, (0, 0), cut.softness))
    texture = warp(cut.texture, local, size, border=cv2.BORDER_REPLICATE)
    return _blended(ground, corner, mask, texture, cut.opacity)


def shade(ground: Image, mask: Image, place: Floats, offset: Floats, opacity: float) -> Image:
    """The ground with the soft shadow of a shape."""
    box = tight_box(_CORNERS, place)
    corner, size = _part(ground, place, 4 + 0.6 * float(box[2:].max()))
    if size < 1:
        return ground
    local = place.copy()
    local[:, 2] += offset * box[2:] - corner
    shadow = warp(mask, local, size, border=cv2.BORDER_CONSTANT)
    reach = 2 * round(0.08 * float(box[2:].max())) + 3
    shadow = np.asarray(cv2.blur(cv2.blur(shadow, (reach, reach)), (reach, reach)))
    return _blended(ground, corner, shadow, np.zeros((size, size, 3), np.uint8), opacity)


def _part(ground: Image, place: Floats, margin: float) -> tuple[Floats, int]:
    """Corner and side of a square of the ground that holds an object with a margin."""
    box = tight_box(_CORNERS, place)
    low = np.clip(np.floor(box[:2] - margin), 0, ground.shape[0])
    high = np.clip(np.ceil(box[:2] + box[2:] + margin), 0, ground.shape[0])
    return low, int((high - low).max()) if (high > low).all() else 0


def _blended(ground: Image, corner: Floats, mask: Image, above: Image, opacity: float) -> Image:
    x, y = (int(value) for value in corner)
    below = ground[y : y + mask.shape[0], x : x + mask.shape[1]]
    rows, columns = below.shape[:2]
    share = (mask[:rows, :columns].astype(np.float32) * np.float32(opacity / 255))[..., None]
    blend = below + (above[:rows, :columns] - below.astype(np.float32)) * share
    result = ground.copy()
    result[y : y + rows, x : x + columns] = blend.astype(np.uint8)
    return result
