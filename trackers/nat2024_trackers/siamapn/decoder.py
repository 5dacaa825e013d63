"""Boxes and scores of SiamAPN and SiamAPN++, whose anchors the network itself proposes."""

import numpy as np
import numpy.typing as npt

from nat2024.types import Floats
from nat2024_trackers.siamese.state import Candidates, Constants
from nat2024_trackers.siamese.tracker import Maps

CELLS = 21
STRIDE = 8

_FIRST_CELL = 63 - 143


def proposal_constants(
    penalty_k: float, window_influence: float, learning_rate: float
) -> Constants:
    """Constants of the loop; the epsilon of the penalty is the official one."""
    return Constants(
        instance_size=287,
        map_size=CELLS,
        stride=STRIDE,
        penalty_k=penalty_k,
        window_influence=window_influence,
        learning_rate=learning_rate,
        ratio_epsilon=1e-5,
    )


class ProposalDecoder:
    """From the maps (cls1, cls2, cls3, loc, anchors) to candidates, one a cell, row by row.

    anchors (n, 4, 21, 21) times `reach` are distances from the cell to the left, right, top and
    bottom side of its anchor; cells lie at -80, -72 .. 80 around the crop's centre. loc
    (n, 4, 21, 21) moves and scales the anchor. The score is a third of the weighted sum of the
    second class's softmax of cls1 and of cls2 and of the raw logit cls3: as in the official code no
    sigmoid is taken, and the weights' own sum does not matter, so that the score is no probability
    and may leave 0..1.
    """

    def __init__(self, reach: int, weights: tuple[float, float, float]) -> None:
        """Lay out the cells once; `reach` in crop pixels, `weights` of cls1, cls2, cls3."""
        self.reach = reach
        self.weights = weights
        centers = np.arange(CELLS) * float(STRIDE) + _FIRST_CELL
        y, x = np.meshgrid(centers, centers, indexing="ij")
        self.x, self.y = x.ravel(), y.ravel()

    def __call__(self, maps: Maps) -> Candidates:
        """Decode a batch; scores float32, boxes float64."""
        first, second, third, offsets, sides = (one.reshape(*one.shape[:2], -1) for one in maps)
        w1, w2, w3 = self.weights
        with np.errstate(all="ignore"):
            scores = (w1 * _foreground(first) + w2 * _foreground(second) + w3 * third[:, 0]) / 3
            x, y, width, height = self.anchors(sides).transpose(1, 0, 2)
            dx, dy, dw, dh = offsets.transpose(1, 0, 2)
            boxes = np.stack(
                [dx * width + x, dy * height + y, np.exp(dw) * width, np.exp(dh) * height], axis=1
            )
        return Candidates(scores, boxes)

    def anchors(self, sides: npt.NDArray[np.floating]) -> Floats:
        """Float64 (n, 4, 441) centre x, y, width, height of the anchors that (n, 4, 441) proposes.

        Sizes are sums of regressed distances and may be negative.
        """
        left, right, top, bottom = (sides * self.reach).astype(np.float64).transpose(1, 0, 2)
        width, height = left + right, top + bottom
        x = self.x - left + width / 2
        y = self.y - top + height / 2
        return np.stack([x, y, width, height], axis=1)


def _foreground(logits: npt.NDArray[np.floating]) -> npt.NDArray[np.floating]:
    """(n, k): softmax of the second of two classes, (n, 2, k)."""
    powers = np.exp(logits - logits.max(axis=1, keepdims=True))
    return np.asarray(powers[:, 1] / powers.sum(axis=1))
