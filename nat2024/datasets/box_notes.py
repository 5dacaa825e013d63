"""What is remarkable about the boxes of a sequence, and harmless by itself."""

from collections.abc import Iterator

import numpy as np

from nat2024.datasets.reading import ReadSequence
from nat2024.datasets.video import VideoFrames
from nat2024.errors import FrameUnreadable
from nat2024.types import Flags

_RANGES = 8


def box_notes(read: ReadSequence) -> Iterator[str]:
    """One line each on rows that are NaN, have no size, or lie outside the image."""
    if read.fault is not None or not len(read.boxes):
        return
    meant = np.ones(len(read.boxes), dtype=bool)
    if read.keyframes is not None:
        meant[:] = False
        meant[read.keyframes] = True
    finite: Flags = np.asarray(np.isfinite(read.boxes).all(axis=1))
    empty: Flags = finite & np.asarray((read.boxes[:, 2:] <= 0).any(axis=1))
    outside = finite & ~empty & _is_outside(read)
    for rows, what in (
        (meant & ~finite, "without a finite box, the target counts as absent"),
        (empty, "with a box of width or height 0 or below"),
        (outside, "with a box wholly outside the image"),
    ):
        if rows.any():
            count = int(rows.sum())
            yield f"{read.name}: {count} frames {what}: {_ranges(rows)} (counted from 0)"
    yield from _video_note(read)


def _is_outside(read: ReadSequence) -> Flags:
    try:
        width, height = read.found.frames.frame_size
    except FrameUnreadable:  # reported as a problem of its own
        return np.zeros(len(read.boxes), dtype=bool)
    x, y, w, h = read.boxes.T
    outside: Flags = (x >= width) | (y >= height) | (x + w <= 0) | (y + h <= 0)
    return outside


def _video_note(read: ReadSequence) -> Iterator[str]:
    frames = read.found.frames
    if isinstance(frames, VideoFrames) and frames.index.stated != len(frames.index.times):
        stated, decoded = frames.index.stated, len(frames.index.times)
        yield f"{read.name}: {frames.path.name} states {stated} frames, {decoded} can be decoded"


def _ranges(rows: Flags) -> str:
    """Row numbers as `3, 7-9`, after some of them only their number."""
    numbers = np.flatnonzero(rows)
    parts = np.split(numbers, np.flatnonzero(np.diff(numbers) > 1) + 1)
    texts = [f"{p[0]}-{p[-1]}" if len(p) > 1 else f"{p[0]}" for p in parts]
    more = f" and {len(texts) - _RANGES} more" if len(texts) > _RANGES else ""
    return ", ".join(texts[:_RANGES]) + more
