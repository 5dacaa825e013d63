"""The evaluation loop in the form that pysot's toolkit has, as a yardstick for speed.

Written from a description of what that toolkit computes: each line of a text file goes through
`float`, each sequence is a numpy array, and each threshold is one comparison over all its frames.
One small kindness beyond the original: tab separated lines are read too.
"""

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

OVERLAPS = np.arange(0, 1.05, 0.05)
PIXELS = np.arange(0, 51, 1)
RATIOS = np.arange(0, 51, 1) / 100


def read(text: bytes) -> Array:
    """float64 (n, 4) of the lines of a box file."""
    rows = []
    for line in text.decode().strip().split("\n"):
        separator = "\t" if "\t" in line else ","
        rows.append([float(field) for field in line.split(separator)])
    return np.array(rows)


def evaluate(
    truths: Mapping[str, bytes], results: Mapping[str, Mapping[str, bytes]]
) -> dict[str, dict[str, tuple[Array, Array, Array]]]:
    """Success, precision and normalised precision curves by tracker and sequence."""
    boxes = {name: read(text) for name, text in truths.items()}
    return {
        tracker: {name: curves(boxes[name], read(text)) for name, text in texts.items()}
        for tracker, texts in results.items()
    }


def curves(truth: Array, result: Array) -> tuple[Array, Array, Array]:
    """The three curves of one sequence; the divisor is the number of its frames."""
    frames = len(truth)
    size = truth[:, 2:4] + 1e-16
    return (
        success(truth, result, frames),
        precision(centers(truth), centers(result), PIXELS, frames),
        precision(centers(truth) / size, centers(result) / size, RATIOS, frames),
    )


def centers(boxes: Array) -> Array:
    """(n, 2) centres of boxes."""
    return np.array([boxes[:, 0] + (boxes[:, 2] - 1) / 2, boxes[:, 1] + (boxes[:, 3] - 1) / 2]).T


def success(truth: Array, result: Array, frames: int) -> Array:
    """Share of frames above each overlap; frames without a target have -1."""
    curve = np.zeros(len(OVERLAPS))
    values = np.ones(len(truth)) * -1
    valid = np.sum(truth[:, 2:] > 0, axis=1) == 2
    values[valid] = overlaps(truth[valid], result[valid])
    for index, threshold in enumerate(OVERLAPS):
        curve[index] = np.sum(values > threshold) / float(frames)
    return curve


def precision(truth: Array, result: Array, thresholds: Array, frames: int) -> Array:
    """Share of frames within each distance; frames with a centre not above 0 have -1."""
    curve = np.zeros(len(thresholds))
    values = np.ones(len(truth)) * -1
    valid = np.sum(truth > 0, axis=1) == 2
    values[valid] = np.sqrt(np.sum(np.power(truth[valid] - result[valid], 2), axis=1))
    for index, threshold in enumerate(thresholds):
        curve[index] = np.sum(values <= threshold) / float(frames)
    return curve


def overlaps(truth: Array, result: Array) -> Array:
    """Intersection over union of rows."""
    left = np.maximum(truth[:, 0], result[:, 0])
    top = np.maximum(truth[:, 1], result[:, 1])
    right = np.minimum(truth[:, 0] + truth[:, 2], result[:, 0] + result[:, 2])
    bottom = np.minimum(truth[:, 1] + truth[:, 3], result[:, 1] + result[:, 3])
    shared = np.maximum(0, right - left) * np.maximum(0, bottom - top)
    union = truth[:, 2] * truth[:, 3] + result[:, 2] * result[:, 3] - shared
    return np.maximum(np.minimum(1, shared / union), 0)
