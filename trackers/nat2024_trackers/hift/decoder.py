"""Boxes and scores of HiFT and LPAT, from distances to the four sides of a box."""

import numpy as np
import numpy.typing as npt

from nat2024_trackers.siamese.state import Candidates, Constants
from nat2024_trackers.siamese.tracker import Maps

CELLS = 11
STRIDE = 16

_REACH = 143
_FIRST_CELL = 63 - _REACH
_LIMIT = np.float32(0.99)


def distance_constants(
    penalty_k: float, window_influence: float, learning_rate: float
) -> Constants:
    """Constants of the loop; the epsilon and the rule for large targets are the official ones."""
    return Constants(
        instance_size=287,
        map_size=CELLS,
        stride=STRIDE,
        penalty_k=penalty_k,
        window_influence=window_influence,
        learning_rate=learning_rate,
        ratio_epsilon=1e-5,
        large_target_share=0.5,
    )


def distances(values: npt.NDArray[np.floating]) -> npt.NDArray[np.floating]:
    """Distances in crop pixels: 143 * atanh(v).

    Values from 1 and values to -1 count as 0.99 and -0.99. As in the official code those just
    within 1 stay, so that the largest distances belong to them.
    """
    within = np.where(values <= -1, -_LIMIT, np.where(values >= 1, _LIMIT, values))
    return np.asarray(np.arctanh(within) * _REACH)


class DistanceDecoder:
    """From the maps (classes, logit, distances) to candidates, one a cell, row by row.

    The score is the mean of the second class's softmax and of the raw logit, so it is no
    probability and may leave 0..1. The four distances reach from the cell to the left, right, top
    and bottom side of the box; cells lie at -80, -64 .. 80 around the crop's centre.
    """

    def __init__(self) -> None:
        """Lay out the cells once."""
        centers = np.arange(CELLS) * float(STRIDE) + _FIRST_CELL
        y, x = np.meshgrid(centers, centers, indexing="ij")
        self.x, self.y = x.ravel(), y.ravel()

    def __call__(self, maps: Maps) -> Candidates:
        """Decode a batch; scores float32, boxes float64."""
        classes, logits, values = (one.reshape(*one.shape[:2], -1) for one in maps)
        with np.errstate(all="ignore"):
            powers = np.exp(classes - classes.max(axis=1, keepdims=True))
            scores = (powers[:, 1] / powers.sum(axis=1) + logits[:, 0]) / 2
            left, right, top, bottom = distances(values).transpose(1, 0, 2)
            width, height = left + right, top + bottom
            x = self.x - left + width / 2
            y = self.y - top + height / 2
        return Candidates(scores, np.stack([x, y, width, height], axis=1))
