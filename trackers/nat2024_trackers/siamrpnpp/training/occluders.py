"""What stands before a target: other objects, poles, foliage; in the template too."""

import cv2
import numpy as np

from nat2024.types import Box, Floats, Image
from nat2024_trackers.siamrpnpp.training.cuts import Cut, draw_cut, lay
from nat2024_trackers.siamrpnpp.training.geometry import Rng, placed
from nat2024_trackers.siamrpnpp.training.shapes import SIDE
from nat2024_trackers.siamrpnpp.training.textures import Photographs, coarse_noise


def occlude_search(
    rng: Rng, photographs: Photographs, search: Image, box: Box, *, procedural: bool
) -> Image:
    """Sometimes another object, or a pole, before the target; its box does not change."""
    chance = rng.random()
    if chance < 0.15:
        cut = draw_occluder(rng, photographs, procedural=procedural)
        size = box[2:] * rng.uniform(0.2, 0.6, size=2)
        middle = box[:2] + box[2:] * rng.uniform(0, 1, size=2)
        return lay(search, cut, _place(size, middle))
    if chance < 0.19:
        colour = [float(value) for value in rng.uniform(10, 200, size=3)]
        x = int(box[0] + box[2] * rng.uniform(0.1, 0.9))
        lean = int(rng.normal(0, 6))
        ends = ((x, 0), (x + lean, search.shape[0]))
        search = search.copy()
        cv2.line(search, *ends, colour, int(rng.integers(2, 8)))
    return search


def occlude_template(
    rng: Rng,
    photographs: Photographs,
    crops: tuple[Image, Image],
    boxes: tuple[Box, Box],
    *,
    procedural: bool,
) -> tuple[Image, Image]:
    """Something before a part of the target in the template, which the target then leaves.

    In the search crop it mostly stands elsewhere beside the target, so that a network which takes
    the occluder for the target is wrong.

    Args:
        rng: chance.
        photographs: what occluders may be cut from.
        crops: template and search.
        boxes: x, y, w, h of the target in each.
        procedural: whether occluders are drawn rather than cut.
    """
    template, search = crops
    cut = draw_occluder(rng, photographs, procedural=procedural)
    angle = float(rng.uniform(0, 2 * np.pi))
    aside = np.array([np.cos(angle), np.sin(angle)]) * rng.uniform(0.25, 0.6)
    share = rng.uniform(0.5, 1.1, size=2)
    template = lay(template, cut, _before(boxes[0], share, aside))
    if rng.random() < 0.75:
        gone = aside + rng.uniform(-1.5, 1.5, size=2)
        search = lay(search, cut, _before(boxes[1], share, gone))
    return template, search


def cover(
    rng: Rng, photographs: Photographs, search: Image, box: Box, *, procedural: bool
) -> Image:
    """The search crop with something before all of a box."""
    cut = draw_occluder(rng, photographs, procedural=procedural)
    share, aside = rng.uniform(1.1, 1.8, size=2), rng.uniform(-0.1, 0.1, size=2)
    return lay(search, cut, _before(box, share, aside))


def draw_occluder(rng: Rng, photographs: Photographs, *, procedural: bool) -> Cut:
    """Foliage or any object."""
    if rng.random() < 0.5 or not len(photographs):
        return foliage(rng)
    return draw_cut(rng, photographs, procedural=procedural)


def foliage(rng: Rng) -> Cut:
    """A ragged, mottled and mostly dark crown."""
    across = np.linspace(-1, 1, SIDE, dtype=np.float32)
    ragged = coarse_noise(rng, SIDE, float(rng.uniform(0.1, 0.35)))[..., 0]
    inside = np.hypot(across[:, None], across[None]) + ragged < rng.uniform(0.75, 0.95)
    colour = rng.uniform(5, 110) * rng.uniform(0.7, 1.2, size=3).astype(np.float32)
    cells = int(rng.integers(12, 49))
    grain = rng.standard_normal((cells, cells, 1), dtype=np.float32)
    mottled = 1 + np.float32(rng.uniform(0.2, 0.7)) * cv2.resize(grain, (SIDE, SIDE))[..., None]
    texture = np.clip(colour * mottled, 0, 255).astype(np.uint8)
    return Cut(texture, np.where(inside, 255, 0).astype(np.uint8))


def _before(box: Box, share: Floats, aside: Floats) -> Floats:
    """The place of an object of a share of a box's size, off its middle by shares of it."""
    return _place(box[2:] * share, box[:2] + box[2:] * (0.5 + aside))


def _place(size: Floats, middle: Floats) -> Floats:
    return placed(np.diag(size / SIDE), np.full(2, SIDE / 2), middle)
