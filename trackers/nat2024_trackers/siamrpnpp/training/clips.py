"""Pairs from sequences with boxes: two frames, cropped exactly as the tracker crops them."""

from collections.abc import Sequence
from typing import TypeAlias

import cv2
import numpy as np
import numpy.typing as npt

from nat2024.errors import UsageError
from nat2024.types import Box, Boxes, FrameSource, Image
from nat2024_trackers.siamese.crops import crop, mean_color, template_side
from nat2024_trackers.siamese.state import Constants, Target
from nat2024_trackers.siamrpnpp.training.geometry import EXEMPLAR, Rng, context_of
from nat2024_trackers.siamrpnpp.training.movement import Ranges, draw_scale, draw_shift
from nat2024_trackers.siamrpnpp.training.occluders import occlude_search, occlude_template
from nat2024_trackers.siamrpnpp.training.photometry import vary_pair
from nat2024_trackers.siamrpnpp.training.textures import Photographs

BoxedClip: TypeAlias = tuple[FrameSource, Boxes]
"""Frames, and float64 (n, 4) boxes; NaN or an empty box where there is no target."""

_ABSENT = 0.1
"""Share of the pairs of clips with such frames whose search crop is of one without the target."""

_TEMPLATE_OCCLUDED = 0.12

_TEMPLATE = Constants(EXEMPLAR, 1, 8, 0.0, 0.0, 0.0)


def usable_frames(boxes: Boxes, *, smallest: float = 3.0) -> npt.NDArray[np.intp]:
    """Numbers of the frames whose box is finite and no side is below `smallest` pixels."""
    with np.errstate(invalid="ignore"):
        fits = np.isfinite(boxes).all(axis=1) & (boxes[:, 2:] >= smallest).all(axis=1)
    return np.flatnonzero(fits)


def clip_pair(
    rng: Rng, clips: Sequence[BoxedClip], ranges: Ranges, photographs: Photographs = ()
) -> tuple[Image, Image, Box]:
    """Template, search crop and box of two frames of one clip; the box is NaN without a target.

    Args:
        rng: chance.
        clips: what frames are drawn from.
        ranges: how far the target may be off.
        photographs: what occluders may be cut from.

    Raises:
        UsageError: ten clips after each other have no frame with a box.
    """
    for _ in range(10):
        frames, boxes = clips[int(rng.integers(len(clips)))]
        usable = usable_frames(boxes)
        if len(usable):
            first, second = rng.choice(usable, size=2).tolist()
            believed, missed = boxes[second], np.flatnonzero(np.isnan(boxes).all(axis=1))
            if len(missed) and rng.random() < _ABSENT:
                second = int(rng.choice(missed))
            shown = (frames[second], boxes[second])
            return _pair(rng, (frames[first], boxes[first]), shown, believed, ranges, photographs)
    msg = "the sequences hardly have boxes; training pairs need frames with a target"
    raise UsageError(msg)


def _pair(
    rng: Rng,
    first: tuple[Image, Box],
    second: tuple[Image, Box],
    around: Box,
    ranges: Ranges,
    photographs: Photographs,
) -> tuple[Image, Image, Box]:
    fill = mean_color(first[0])
    target = Target.from_annotation(first[1])
    template = crop(first[0], target, template_side(target, _TEMPLATE), EXEMPLAR, fill)
    # What the tracker would believe before this frame: off in place and size.
    truth = Target.from_annotation(around)
    error = draw_scale(rng, ranges)
    side = context_of(truth.width, truth.height) / error
    scale = EXEMPLAR / side
    dx, dy = draw_shift(rng, ranges)
    believed = Target(
        truth.center_x - dx / scale, truth.center_y - dy / scale, truth.width, truth.height
    )
    window = max(1, round(side * ranges.search / EXEMPLAR))
    search = crop(second[0], believed, window, ranges.search, fill)
    box = np.array([dx, dy, truth.width * scale, truth.height * scale])
    if rng.random() < 0.5:
        template, search, box[0] = _mirrored(template), _mirrored(search), -dx
    zoom = EXEMPLAR / context_of(target.width, target.height)
    corners = (
        _corner_box(np.array([0, 0, target.width * zoom, target.height * zoom]), EXEMPLAR),
        _corner_box(box, ranges.search),
    )
    template, search = _occluded(rng, photographs, (template, search), corners)
    template, search = vary_pair(rng, template, search)
    is_there = bool(np.isfinite(second[1]).all())
    return template, search, box if is_there else np.full(4, np.nan)


def _occluded(
    rng: Rng,
    photographs: Photographs,
    crops: tuple[Image, Image],
    boxes: tuple[Box, Box],
) -> tuple[Image, Image]:
    template, search = crops
    if rng.random() < _TEMPLATE_OCCLUDED:
        return occlude_template(rng, photographs, (template, search), boxes, procedural=False)
    if rng.random() < 0.4:
        search = occlude_search(rng, photographs, search, boxes[1], procedural=False)
    return template, search


def _corner_box(box: Box, side: int) -> Box:
    return np.concatenate([box[:2] + side / 2 - box[2:] / 2, box[2:]])


def _mirrored(image: Image) -> Image:
    return np.asarray(cv2.flip(image, 1), dtype=np.uint8)
