"""From decoded candidates to the next box: penalty, window, choice, update."""

import numpy as np
import numpy.typing as npt

from nat2024.types import Floats
from nat2024_trackers.siamese.crops import SearchWindow
from nat2024_trackers.siamese.state import Constants, Step, Target

SMALLEST_SIZE = 10.0
"""Width and height in image pixels that a tracked target never falls below."""


def cosine_window(constants: Constants) -> Floats:
    """Hanning window over the map, zero on its border, flattened and repeated for each anchor."""
    hanning = np.hanning(constants.map_size)
    return np.tile(np.outer(hanning, hanning).ravel(), constants.anchors)


def penalties(
    boxes: npt.NDArray[np.floating], target: Target, scale: float, constants: Constants
) -> Floats:
    """Penalty 0..1 of every candidate's change of scale and shape.

    Args:
        boxes: (4, k), of which rows 2 and 3, width and height in crop pixels, are read.
        target: the state before this frame.
        scale: crop pixels a image pixel.
        constants: of the tracker.
    """
    epsilon = constants.ratio_epsilon
    size = _padded_size(np.float64(target.width * scale), np.float64(target.height * scale))
    with np.errstate(all="ignore"):
        sizes = _padded_size(boxes[2], boxes[3]).astype(np.float64)
        shapes = (boxes[2] / (boxes[3] + epsilon)).astype(np.float64)
        scale_change = _change(sizes / size, epsilon)
        shape_change = _change(target.width / (target.height + epsilon) / shapes, epsilon)
        penalty: Floats = np.exp(-(shape_change * scale_change - 1) * constants.penalty_k)
    return penalty


def _padded_size(
    width: npt.NDArray[np.floating] | np.float64, height: npt.NDArray[np.floating] | np.float64
) -> npt.NDArray[np.floating]:
    with np.errstate(all="ignore"):
        pad = (width + height) * 0.5
        return np.asarray(np.sqrt((width + pad) * (height + pad)))


def _change(ratio: Floats, epsilon: float) -> Floats:
    return np.maximum(ratio, 1.0 / (ratio + epsilon))


def select(
    scores: npt.NDArray[np.floating],
    boxes: npt.NDArray[np.floating],
    target: Target,
    searched: SearchWindow,
    window: Floats,
    frame_size: tuple[int, int],
    constants: Constants,
) -> Step:
    """Choose the best candidate of one sequence and move the target to it.

    Candidates whose penalised score or box is no finite number are never chosen (official code
    differs: `argmax` would take the first NaN and lose the state); without any other the target
    stays, with score 0 and index -1.

    Args:
        scores: (k,) raw scores.
        boxes: (4, k) centre offset, width and height in crop pixels.
        target: the state before this frame.
        searched: the search crop.
        window: (k,) from `cosine_window`.
        frame_size: (width, height) of the frame.
        constants: of the tracker.
    """
    penalty = penalties(boxes, target, searched.scale, constants)
    influence = constants.window_influence
    with np.errstate(all="ignore"):
        pscores = penalty * scores * (1 - influence) + window * influence
    usable = np.isfinite(pscores) & np.isfinite(scores) & np.isfinite(boxes).all(axis=0)
    if not usable.any():
        return Step(target, 0.0, 0.0, -1, searched.side)
    best = int(np.argmax(np.where(usable, pscores, -np.inf)))
    score = float(scores[best])
    rate = float(penalty[best]) * score * constants.learning_rate
    moved = _move(target, boxes[:, best].astype(np.float64) / searched.scale, rate, frame_size)
    return Step(moved, score, float(pscores[best]), best, searched.side)


def _move(target: Target, found: Floats, rate: float, frame_size: tuple[int, int]) -> Target:
    """The centre jumps, the size follows at `rate`; both are clipped to the image."""
    dx, dy, width, height = found.tolist()
    frame_width, frame_height = frame_size
    return Target(
        _clip(target.center_x + dx, 0.0, frame_width),
        _clip(target.center_y + dy, 0.0, frame_height),
        _clip(target.width * (1 - rate) + width * rate, SMALLEST_SIZE, frame_width),
        _clip(target.height * (1 - rate) + height * rate, SMALLEST_SIZE, frame_height),
    )


def _clip(value: float, low: float, high: float) -> float:
    # In this order as in the official code: images below 10 pixels give 10.
    return float(max(low, min(value, high)))
