"""From NanoTrack's maps to candidates: a grid of points, and four distances at each."""

import numpy as np
import numpy.typing as npt

from nat2024_trackers.siamese.state import Candidates, Constants
from nat2024_trackers.siamese.tracker import Maps


def grid_points(constants: Constants) -> npt.NDArray[np.float32]:
    """Points, float32 (2, k): x and y from the crop's centre, row by row.

    A side of 16 cells runs from -128 to 112, so that the grid's middle is not the crop's.
    """
    n = constants.map_size
    along = ((np.arange(n) - n // 2) * constants.stride).astype(np.float32)
    y, x = np.meshgrid(along, along, indexing="ij")
    return np.stack([x.ravel(), y.ravel()])


class PointDecoder:
    """From the maps (cls, loc) to candidates.

    cls (n, 2, map, map): the score is the softmax's second. loc (n, 4, map, map): distances from
    the point to the left, top, right and bottom edge in crop pixels.
    """

    def __init__(self, constants: Constants) -> None:
        """Lay out the points once."""
        self.points = grid_points(constants)

    def __call__(self, maps: Maps) -> Candidates:
        """Decode a batch."""
        classes, distances = maps
        count = len(classes)
        logits = classes.reshape(count, 2, -1)
        left, top, right, bottom = distances.reshape(count, 4, -1).transpose(1, 0, 2)
        x, y = self.points
        with np.errstate(all="ignore"):
            powers = np.exp(logits - logits.max(axis=1, keepdims=True))
            scores = powers[:, 1] / powers.sum(axis=1)
            x1, y1, x2, y2 = x - left, y - top, x + right, y + bottom
            boxes = np.stack([(x1 + x2) * 0.5, (y1 + y2) * 0.5, x2 - x1, y2 - y1], axis=1)
        return Candidates(scores, boxes)
