"""Numbers in few bytes: arrays as base64 text of small integers, and long series as short ones."""

import base64

import numpy as np
import numpy.typing as npt

OVERLAP_STEPS = 254
"""Overlap 0..1 in as many steps; 255 stands for NaN."""

ERROR_STEP = 0.1
"""Pixels of one step of a centre error; 65535 stands for NaN."""

SHARE_STEPS = 65534
"""A share 0..1 in as many steps; 65535 stands for NaN."""


def encode(values: npt.NDArray[np.uint8] | npt.NDArray[np.uint16]) -> str:
    """Base64 of the values, 16-bit ones with the low byte first."""
    little = values.astype(values.dtype.newbyteorder("<"), copy=False)
    return base64.b64encode(little.tobytes()).decode()


def overlap_bytes(values: npt.ArrayLike) -> npt.NDArray[np.uint8]:
    """Overlaps as 8-bit steps; what is not exactly 0 never becomes 0, since 0 is a loss."""
    given = np.asarray(values, dtype=np.float64)
    known = np.isfinite(given)
    clipped = np.clip(np.where(known, given, 0.0), 0.0, 1.0)
    steps = np.maximum(np.rint(clipped * OVERLAP_STEPS), clipped > 0)
    return np.where(known, steps, 255).astype(np.uint8)


def error_words(values: npt.ArrayLike) -> npt.NDArray[np.uint16]:
    """Pixels as 16-bit steps of `ERROR_STEP`, at most 6553.4."""
    given = np.asarray(values, dtype=np.float64)
    known = np.isfinite(given)
    steps = np.clip(np.rint(np.where(known, given, 0.0) / ERROR_STEP), 0, 65534)
    return np.where(known, steps, 65535).astype(np.uint16)


def share_words(values: npt.ArrayLike) -> npt.NDArray[np.uint16]:
    """Shares in 0..1 as 16-bit steps; a share above 1 counts as 1."""
    given = np.asarray(values, dtype=np.float64)
    known = np.isfinite(given)
    steps = np.rint(np.clip(np.where(known, given, 0.0), 0.0, 1.0) * SHARE_STEPS)
    return np.where(known, steps, 65535).astype(np.uint16)


def extremes(values: npt.ArrayLike, points: int) -> npt.NDArray[np.float64]:
    """A series of at most about `points` values that keeps every peak and every dip.

    The series is cut into bins of equal width, and each gives its smallest and largest value in the
    order in which they come; a bin without a number gives NaN. `sample_frames` has the frames at
    which they are drawn.
    """
    given = np.asarray(values, dtype=np.float64)
    width = _bin_width(len(given), points)
    if width == 1:
        return given
    table = np.full((-(-len(given) // width), width), np.nan)
    table.reshape(-1)[: len(given)] = given
    known = np.isfinite(table)
    lowest = np.where(known, table, np.inf).argmin(axis=1)
    highest = np.where(known, table, -np.inf).argmax(axis=1)
    order = np.stack([np.minimum(lowest, highest), np.maximum(lowest, highest)], axis=1)
    pairs = np.take_along_axis(table, order, axis=1)
    pairs[~known.any(axis=1)] = np.nan
    return pairs.reshape(-1)


def sample_frames(length: int, points: int) -> npt.NDArray[np.int64]:
    """0-based frames at which `extremes` of a series of this length is drawn."""
    width = _bin_width(length, points)
    if width == 1:
        return np.arange(length)
    starts = np.arange(0, length, width)
    last = np.minimum(starts + width, length) - 1
    return np.stack([starts + (last - starts) // 4, last - (last - starts) // 4], 1).reshape(-1)


def _bin_width(length: int, points: int) -> int:
    return 1 if length <= points else -(-2 * length // points)
