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
from nat2024_trackers.siamrpnpp.training.photometry import vary_pair

BoxedClip: TypeAlias = tuple[FrameSource, Boxes]
"""Frames, and float64 (n, 4) boxes; NaN or an empty box where there is no target."""

_TEMPLATE = Constants(EXEMPLAR, 1, 8, 0.0, 0.0, 0.0)


def usable_frames(boxes: Boxes, *, smallest: float = 3.0) -> npt.NDArray[np.intp]:
    """Numbers of the frames whose box is finite and no side is below `smallest` pixels."""
    with np.errstate(invalid="ignore"):
        fits = np.isfinite(boxes).all(axis=1) & (boxes[:, 2:] >= smallest).all(axis=1)
    return np.flatnonzero(fits)


def clip_pair(rng: Rng, clips: Sequence[BoxedClip], ranges: Ranges) -> tuple[Image, Image, Box]:
    """Template, search crop and box of two frames of one clip.

    Raises:
        UsageError: ten clips after each other have no frame with a box.
    """
    for _ in range(10):
        frames, boxes = clips[int(rng.integers(len(clips)))]
        usable = usable_frames(boxes)
        if len(usable):
            first, second = rng.choice(usable, size=2).tolist()
            return _pair(
                rng, (frames[first], boxes[first]), (frames[second], boxes[second]), ranges
            )
    msg = "the sequences hardly have boxes; training pairs need frames with a target"
    raise UsageError(msg)


def _pair(
    rng: Rng, first: tuple[Image, Box], second: tuple[Image, Box], ranges: Ranges
) -> tuple[Image, Image, Box]:
    fill = mean_color(first[0])
    target = Target.from_annotation(first[1])
    template = crop(first[0], target, template_side(target, _TEMPLATE), EXEMPLAR, fill)
    # What the tracker would believe before this frame: off in place and size.
    truth = Target.from_annotation(second[1])
    error = draw_scale(rng, ranges)
    side = context_of(truth.width, truth.height) / error
    scale = EXEMPLAR / side
    dx, dy = draw_shift(rng, ranges)
    believed = Target(
        truth.center_x - dx / scale, truth.center_y - dy / scale, truth.width, truth.height
    )
    window = max(1, round(side * ranges.search / EXEMPLAR))
    search = crop(second[0], believed, window, ranges.search, fill)
    width, height = truth.width * scale, truth.height * scale
    if rng.random() < 0.5:
        template, search, dx = _mirrored(template), _mirrored(search), -dx
    template, search = vary_pair(rng, template, search)
    return template, search, np.array([dx, dy, width, height])


def _mirrored(image: Image) -> Image:
    return np.asarray(cv2.flip(image, 1), dtype=np.uint8)
