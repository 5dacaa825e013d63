"""From decoded candidates to the next box: penalty, window, choice, update."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from nat2024.types import Floats
from nat2024_trackers.siamese.crops import SearchWindow
from nat2024_trackers.siamese.state import Candidates, Constants, Step, Target

SMALLEST_SIZE = 10.0
"""Width and height in image pixels that a tracked target never falls below."""


def cosine_window(constants: Constants) -> Floats:
    """Hanning window over the map, zero on its border, flattened and repeated for each anchor."""
    hanning = np.hanning(constants.map_size)
    return np.tile(np.outer(hanning, hanning).ravel(), constants.anchors)


def penalties(
    boxes: npt.NDArray[np.floating],
    targets: Sequence[Target],
    scales: Sequence[float],
    constants: Constants,
) -> Floats:
    """Penalty 0..1, (n, k), of every candidate's change of scale and shape.

    Args:
        boxes: (n, 4, k), of which rows 2 and 3, width and height in crop pixels, are read.
        targets: the states before this frame.
        scales: crop pixels a image pixel.
        constants: of the tracker.
    """
    epsilon = constants.ratio_epsilon
    width, height = np.array([(target.width, target.height) for target in targets]).T[..., None]
    scale = np.array(scales)[:, None]
    widths, heights = boxes[:, 2], boxes[:, 3]
    with np.errstate(all="ignore"):
        sizes = _padded_size(widths, heights).astype(np.float64)
        shapes = (widths / (heights + epsilon)).astype(np.float64)
        size = _padded_size(width * scale, height * scale)
        scale_change = _change(sizes / size, epsilon)
        shape_change = _change(width / (height + epsilon) / shapes, epsilon)
        penalty: Floats = np.exp(-(shape_change * scale_change - 1) * constants.penalty_k)
    return penalty


def _padded_size(
    width: npt.NDArray[np.floating], height: npt.NDArray[np.floating]
) -> npt.NDArray[np.floating]:
    with np.errstate(all="ignore"):
        pad = (width + height) * 0.5
        return np.asarray(np.sqrt((width + pad) * (height + pad)))


def _change(ratio: Floats, epsilon: float) -> Floats:
    return np.maximum(ratio, 1.0 / (ratio + epsilon))


def select(
    found: Candidates,
    targets: Sequence[Target],
    searched: Sequence[SearchWindow],
    window: Floats,
    frame_sizes: Sequence[tuple[int, int]],
    constants: Constants,
) -> list[Step]:
    """Choose the best candidate of each sequence and move its target there.

    Candidates whose penalised score or box is no finite number are never chosen (official code
    differs: `argmax` would take the first NaN and lose the state); without any other the target
    stays, with score 0 and index -1.

    Args:
        found: candidates of n sequences.
        targets: the states before this frame.
        searched: the search crops.
        window: (k,) from `cosine_window`.
        frame_sizes: (width, height) of the frames.
        constants: of the tracker.
    """
    scores, boxes = found.scores, found.boxes
    penalty = penalties(boxes, targets, [one.scale for one in searched], constants)
    influence = constants.window_influence
    with np.errstate(all="ignore"):
        pscores = penalty * scores * (1 - influence) + window * influence
    usable = np.isfinite(pscores) & np.isfinite(scores) & np.isfinite(boxes).all(axis=1)
    chosen = np.argmax(np.where(usable, pscores, -np.inf), axis=1).tolist()
    steps = []
    for row, best in enumerate(chosen):
        target, side = targets[row], searched[row].side
        if not usable[row, best]:
            steps.append(Step(target, 0.0, 0.0, -1, side))
            continue
        score = float(scores[row, best])
        rate = float(penalty[row, best]) * score * constants.learning_rate
        box = boxes[row, :, best].astype(np.float64) / searched[row].scale
        moved = _move(target, box, rate, frame_sizes[row])
        steps.append(Step(moved, score, float(pscores[row, best]), best, side))
    return steps


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
