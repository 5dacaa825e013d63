"""Anchors of SiamRPN++ and the decoding of its maps, in float32 as in the official code."""

import math

import numpy as np
import numpy.typing as npt

from nat2024_trackers.siamese.state import Candidates, Constants
from nat2024_trackers.siamese.tracker import Maps

RATIOS = (0.33, 0.5, 1.0, 2.0, 3.0)
SCALE = 8


def anchor_boxes(constants: Constants) -> npt.NDArray[np.float32]:
    """Anchors, float32 (4, k): centre offset x, y, width, height; k = anchor, row, column."""
    n, stride = constants.map_size, constants.stride
    widths, heights = [], []
    for ratio in RATIOS:
        width = int(math.sqrt(stride * stride / ratio))
        widths.append(width * SCALE)
        heights.append(int(width * ratio) * SCALE)
    centers = (np.arange(n) - n // 2) * stride
    shape = (len(RATIOS), n, n)
    columns = (
        np.broadcast_to(centers[None, None, :], shape),
        np.broadcast_to(centers[None, :, None], shape),
        np.broadcast_to(np.array(widths)[:, None, None], shape),
        np.broadcast_to(np.array(heights)[:, None, None], shape),
    )
    return np.stack([column.ravel() for column in columns]).astype(np.float32)


class AnchorDecoder:
    """From the maps (cls, loc) to candidates.

    cls (n, 2A, map, map): channels 0..A-1 background, A..2A-1 foreground of the A anchors; the
    score is the softmax over the two. loc (n, 4A, map, map): channel A*j + a is coordinate j
    (dx, dy, dw, dh) of anchor a.
    """

    def __init__(self, constants: Constants) -> None:
        """Lay out the anchors once."""
        self.anchors = anchor_boxes(constants)

    def __call__(self, maps: Maps) -> Candidates:
        """Decode a batch."""
        classes, offsets = maps
        count = len(classes)
        logits = classes.reshape(count, 2, -1)
        dx, dy, dw, dh = offsets.reshape(count, 4, -1).transpose(1, 0, 2)
        x, y, width, height = self.anchors
        with np.errstate(all="ignore"):
            powers = np.exp(logits - logits.max(axis=1, keepdims=True))
            scores = powers[:, 1] / powers.sum(axis=1)
            boxes = np.stack(
                [dx * width + x, dy * height + y, np.exp(dw) * width, np.exp(dh) * height], axis=1
            )
        return Candidates(scores, boxes)
