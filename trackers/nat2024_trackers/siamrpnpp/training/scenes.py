"""Pairs made of photographs: objects cut out and laid on others, and regions as they are."""

from collections.abc import Iterator
from dataclasses import replace

import cv2
import numpy as np

from nat2024.types import Box, Floats, Image
from nat2024_trackers.siamrpnpp.training.cuts import (
    Cut,
    Placed,
    brightened,
    draw_cut,
    draw_target,
    lay,
    shade,
)
from nat2024_trackers.siamrpnpp.training.geometry import (
    EXEMPLAR,
    Rng,
    after,
    context_of,
    linear_map,
    outline_of,
    placed,
    standard_size,
    tight_box,
    warp,
)
from nat2024_trackers.siamrpnpp.training.movement import Move, Ranges, draw_move
from nat2024_trackers.siamrpnpp.training.occluders import cover, occlude_search, occlude_template
from nat2024_trackers.siamrpnpp.training.photometry import expose_pair
from nat2024_trackers.siamrpnpp.training.shapes import SIDE
from nat2024_trackers.siamrpnpp.training.textures import (
    Photographs,
    photograph_map,
    plain_surface,
    recoloured,
)

_ABSENT = 0.07
"""Share of the pairs without the target in the search crop."""

_TEMPLATE_OCCLUDED = 0.18
"""Share of the pairs with something before the target in the template."""


def cut_pair(
    rng: Rng, photographs: Photographs, ranges: Ranges, *, procedural: bool
) -> tuple[Image, Image, Box]:
    """A pair of an object that was cut out of a photograph, or drawn."""
    target, later = draw_target(rng, photographs, procedural=procedural)
    aspect = float(np.exp(np.clip(rng.normal(0, 0.5), -1.2, 1.2)))
    template_map = template_placement(rng, target.mask, aspect)
    move = draw_move(rng, ranges, turns=True)
    search_map = search_placement(template_map, later.mask, move, ranges.search)
    sides = (EXEMPLAR, ranges.search)
    grounds = _backgrounds(rng, photographs, move, sides, plain=0.56 if procedural else 0.12)
    others = _distractors(rng, photographs, later, search_map, ranges, procedural=procedural)
    shadow = (rng.uniform(-0.4, 0.4, size=2), rng.uniform(0.2, 0.6)) if rng.random() < 0.4 else None
    shown = brightened(rng, later)
    template, search = grounds
    shared = others[:1] if rng.random() < 0.4 else []
    for cut, place in shared:
        template = lay(template, cut, _beside(rng, place, EXEMPLAR))
    for cut, place in others:
        search = lay(search, cut, place)
    is_absent = rng.random() < _ABSENT
    if shadow:
        template = shade(template, target.mask, template_map, *shadow)
        search = search if is_absent else shade(search, later.mask, search_map, *shadow)
    template = lay(template, target, template_map)
    first = tight_box(outline_of(target.mask), template_map)
    box = tight_box(outline_of(later.mask), search_map)
    search = search if is_absent else lay(search, shown, search_map)
    template, search = _hidden(
        rng, photographs, (template, search), (first, box), absent=is_absent, procedural=procedural
    )
    template, search = expose_pair(rng, template, search)
    return template, search, np.full(4, np.nan) if is_absent else centred(box, ranges.search)


def _hidden(
    rng: Rng,
    photographs: Photographs,
    crops: tuple[Image, Image],
    boxes: tuple[Box, Box],
    *,
    absent: bool,
    procedural: bool,
) -> tuple[Image, Image]:
    """Both crops with what stands before the target."""
    template, search = crops
    if rng.random() < _TEMPLATE_OCCLUDED:
        both = (template, search)
        template, search = occlude_template(rng, photographs, both, boxes, procedural=procedural)
    if not absent:
        search = occlude_search(rng, photographs, search, boxes[1], procedural=procedural)
    elif rng.random() < 0.5:
        search = cover(rng, photographs, search, boxes[1], procedural=procedural)
    return template, search


def centred(box: Box, side: int) -> Box:
    """From a corner box in a crop to the offset of its centre from the crop's, and its size."""
    return np.array([*(box[:2] + box[2:] / 2 - side / 2), *box[2:]])


def template_placement(rng: Rng, mask: Image, aspect: float) -> Floats:
    """Map of an object into a template crop, so that its tight box is where the tracker puts it.

    The object is of shape `aspect` before it is turned a little; its tight box is then centred
    and of the standard size, but for the small errors of an annotator.
    """
    outline = outline_of(mask)
    width, height = standard_size(aspect)
    linear = linear_map(width=width / SIDE, height=height / SIDE, angle=float(rng.normal(0, 0.1)))
    box = tight_box(outline, placed(linear, np.zeros(2), np.zeros(2)))
    zoom = EXEMPLAR / context_of(box[2], box[3]) * float(np.exp(rng.normal(0, 0.03)))
    middle = EXEMPLAR / 2 + rng.normal(0, 1.5, size=2)
    return np.column_stack([zoom * linear, middle - zoom * (box[:2] + box[2:] / 2)])


def search_placement(template_map: Floats, mask: Image, move: Move, side: int) -> Floats:
    """Map of the object into the search crop after a move."""
    moved = after(np.column_stack([move.linear, np.zeros(2)]), template_map)
    box = tight_box(outline_of(mask), moved)
    moved[:, 2] += side / 2 + move.shift - (box[:2] + box[2:] / 2)
    return moved


def still_pair(rng: Rng, photographs: Photographs, ranges: Ranges) -> tuple[Image, Image, Box]:
    """A pair of a region of a photograph, moved together with what surrounds it."""
    photograph = photographs[int(rng.integers(len(photographs)))]
    x, y, width, height = max((_region(rng, photograph) for _ in range(3)), key=_spread(photograph))
    middle = np.array([x + width / 2, y + height / 2])
    zoom = EXEMPLAR / context_of(width, height)
    base = linear_map(width=zoom, height=zoom)
    first = placed(base, middle, EXEMPLAR / 2 + rng.uniform(-4, 4, size=2))
    move = draw_move(rng, ranges)
    linear = move.linear @ base
    second = placed(linear, middle, ranges.search / 2 + move.shift)
    # bounds of the inscribed ellipse: those of the turned rectangle would always be larger
    half = linear @ np.diag([width / 2, height / 2])
    box = np.array([*move.shift, *(2 * np.linalg.norm(half, axis=1))])
    border = cv2.BORDER_REFLECT_101 if rng.random() < 0.5 else cv2.BORDER_REPLICATE
    template = warp(photograph, first, EXEMPLAR, border=border)
    search = warp(photograph, second, ranges.search, border=border)
    if rng.random() < 0.3:
        template, search = (np.ascontiguousarray(one[:, ::-1]) for one in (template, search))
        box[0] = -box[0]
    template, search = expose_pair(rng, template, search)
    return template, search, box


def _region(rng: Rng, photograph: Image) -> tuple[float, float, float, float]:
    height, width = photograph.shape[:2]
    size = float(rng.uniform(0.06, 0.4)) * min(height, width)
    stretch = float(np.exp(np.clip(rng.normal(0, 0.45), -1, 1) / 2))
    w, h = size * stretch, size / stretch
    return float(rng.uniform(0, width - w)), float(rng.uniform(0, height - h)), w, h


def _spread(photograph: Image):  # type: ignore[no-untyped-def]
    def of(region: tuple[float, float, float, float]) -> float:
        x, y, w, h = (int(value) for value in region)
        return float(photograph[y : y + max(h, 2), x : x + max(w, 2)].std())

    return of


def _backgrounds(
    rng: Rng, photographs: Photographs, move: Move, sides: tuple[int, int], *, plain: float
) -> tuple[Image, Image]:
    if rng.random() < plain:
        surface = plain_surface(rng, photographs, sides[1])
        first = np.ascontiguousarray(surface[: sides[0], : sides[0]])
        if rng.random() < 0.35:
            surface = plain_surface(rng, photographs, sides[1])
        return first, surface.copy()
    photograph = photographs[int(rng.integers(len(photographs)))]
    first_map = photograph_map(rng, photograph, sides[0])
    if rng.random() < 0.65:
        second_map = _moved_ground(rng, first_map, move, sides)
        second = photograph
    else:
        is_other = rng.random() < 0.3
        second = photographs[int(rng.integers(len(photographs)))] if is_other else photograph
        second_map = photograph_map(rng, second, sides[1])
    return warp(photograph, first_map, sides[0]), warp(second, second_map, sides[1])


def _moved_ground(rng: Rng, first: Floats, move: Move, sides: tuple[int, int]) -> Floats:
    """The same spot; where a wrong size was assumed for the crop the ground changes scale too."""
    zoom = float(np.exp(rng.uniform(-0.15, 0.15))) * (move.scale if rng.random() < 0.6 else 1.0)
    turn = linear_map(width=zoom, height=zoom, angle=float(rng.normal(0, 0.12)))
    middle = np.full(2, sides[0] / 2)
    step = placed(turn, middle, np.full(2, sides[1] / 2) + rng.normal(0, 25, size=2))
    return after(step, first)


def _distractors(
    rng: Rng,
    photographs: Photographs,
    target: Cut,
    search_map: Floats,
    ranges: Ranges,
    *,
    procedural: bool,
) -> list[Placed]:
    """Other objects of about the target's size, none of them on the target."""
    if rng.random() >= 0.6:
        return []
    return list(_others(rng, photographs, target, search_map, ranges, procedural=procedural))


def _others(
    rng: Rng,
    photographs: Photographs,
    target: Cut,
    search_map: Floats,
    ranges: Ranges,
    *,
    procedural: bool,
) -> Iterator[Placed]:
    box = tight_box(outline_of(target.mask), search_map)
    for _ in range(int(rng.integers(1, 4))):
        other = draw_cut(rng, photographs, procedural=procedural)
        kind = rng.random()
        if kind < 0.35:
            other = replace(other, mask=target.mask)
        elif kind < 0.6:
            other = replace(other, mask=target.mask, texture=recoloured(rng, target.texture))
        size = box[2:] * np.exp(rng.uniform(-0.35, 0.35, size=2))
        middle = rng.uniform(0, ranges.search, size=2)
        apart = 0.75 * box[2:].max()
        if np.abs(middle - (box[:2] + box[2:] / 2)).max() >= apart:
            yield other, placed(np.diag(size / SIDE), np.full(2, SIDE / 2), middle)


def _beside(rng: Rng, place: Floats, side: int) -> Floats:
    """A place at the edge of the template crop for an object of the search crop."""
    angle = float(rng.uniform(0, 2 * np.pi))
    away = np.array([np.cos(angle), np.sin(angle)]) * side * rng.uniform(0.42, 0.6)
    return placed(place[:, :2], np.full(2, SIDE / 2), np.full(2, side / 2) + away)
