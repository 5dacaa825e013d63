"""Which anchors a target belongs to, and the offsets from them to its box."""

from dataclasses import dataclass

import torch
from torch import Tensor

_POSITIVE = 0.6
_BEST = 0.2
_NEGATIVE = 0.3


@dataclass(frozen=True, slots=True)
class Assignment:
    """For every anchor of every pair.

    Attributes:
        positive: bool (n, k).
        negative: bool (n, k); anchors that are neither do not count.
        offsets: float32 (n, 4, k): dx, dy in anchor sizes, dw, dh as logarithms of ratios.
    """

    positive: Tensor
    negative: Tensor
    offsets: Tensor


def assign(boxes: Tensor, anchors: Tensor) -> Assignment:
    """Assign anchors to targets by place and shape.

    Each anchor is first given the area of the target: what has to be found is where it is, and how
    large it is has to be measured from anywhere. (With overlaps of unscaled anchors, as in pysot,
    a target half again as large as assumed has hardly any positive anchor.)

    Args:
        boxes: float32 (n, 4) centre offset x, y, width, height in crop pixels; NaN where the
            target is not in the crop, so that every anchor is negative.
        anchors: float32 (4, k) in the same form, of `anchor_boxes`.
    """
    x, y, width, height = (part[:, None] for part in boxes.T)
    ax, ay, aw, ah = (part[None] for part in anchors)
    zoom = torch.sqrt(width * height / (aw * ah))
    overlap = _overlap((x, y, width, height), (ax, ay, aw * zoom, ah * zoom))
    best = overlap.amax(dim=1, keepdim=True)
    positive = (overlap > _POSITIVE) | ((overlap >= best) & (overlap > _BEST))
    offsets = torch.stack(
        [(x - ax) / aw, (y - ay) / ah, torch.log(width / aw), torch.log(height / ah)], dim=1
    )
    # An overlap with no target is NaN, which is not above anything.
    return Assignment(positive, ~(overlap >= _NEGATIVE) & ~positive, offsets.nan_to_num())


def _overlap(first: tuple[Tensor, ...], second: tuple[Tensor, ...]) -> Tensor:
    """Intersection over union of centre boxes."""
    shared = torch.ones_like(first[0])
    for axis in (0, 1):
        low = torch.maximum(first[axis] - first[axis + 2] / 2, second[axis] - second[axis + 2] / 2)
        high = torch.minimum(first[axis] + first[axis + 2] / 2, second[axis] + second[axis + 2] / 2)
        shared = shared * (high - low).clamp(min=0)
    return shared / (first[2] * first[3] + second[2] * second[3] - shared)
