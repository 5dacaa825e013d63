"""The loop: start on a box, follow frame by frame, and pay for slowness as on board."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from nat2024.engine import name_failures, track_frame
from nat2024.engine.timing import now
from nat2024.errors import UsageError
from nat2024.interfaces import Tracker
from nat2024.live.sources import LiveSource
from nat2024.types import Box, Floats, Image

Arrival: TypeAlias = Literal["wait", "live"]
"""Whether frames wait for the tracker, or go on without it."""


@dataclass(frozen=True, slots=True)
class LiveFrame:
    """One frame of the source, in order.

    Attributes:
        index: number of the frame in the source, 0-based.
        box: float64 (4,) x, y, w, h; on a frame that was skipped, the last one found.
        score: the tracker's; NaN on the first frame and on those that were skipped.
        seconds: (3,) for reading, enhancing and tracking; zeros on a frame that was skipped.
        is_skipped: whether the tracker never saw this frame.
        image: uint8 (H, W, 3) BGR; None on a frame that was skipped, or not kept.
    """

    index: int
    box: Box
    score: float
    seconds: Floats
    is_skipped: bool = False
    image: Image | None = None


def follow(
    source: LiveSource,
    tracker: Tracker,
    box: Box,
    *,
    start: int = 0,
    max_frames: int | None = None,
    arrival: Arrival = "wait",
) -> Iterator[LiveFrame]:
    """Track from frame `start` on; one `LiveFrame` for each frame of the source.

    With arrival "live" late frames are skipped as a camera's would be. A file is then played at its
    rate on a clock that only enhancing and tracking advance, so that the outcome depends on the
    speed of the method alone, not on that of the disk or of whoever draws the boxes. A camera or
    stream always runs at its own pace and gives the newest frame, whatever `arrival` says.

    The tracker warms up on the first frame before the clock starts, as it would on the ground.

    Args:
        source: open.
        tracker: its enhancer may be a `TimedEnhancer`, whose time is then told apart.
        box: x, y, w, h of the target in the first frame.
        start: frames left out before it.
        max_frames: stop after so many frames, skipped ones included.
        arrival: whether frames wait for the tracker.

    Raises:
        UsageError: the source ends before frame `start`.
        FrameUnreadable: a frame cannot be decoded; frames before it have been told.
        NatBenchError: the tracker fails; names the frame, counted from 0.
    """
    source.skip(start)
    begin = now()
    first = source.read()
    read_seconds = now() - begin
    if first is None:
        msg = f"{source.title}: ends before frame {start}, counted from 0"
        raise UsageError(msg)
    with name_failures(f"{source.title}, frame {start}"):
        tracker.init(first, box)
        tracker.update(first)
        row, _, seconds = track_frame(tracker, first, box)
    yield LiveFrame(start, row, float("nan"), np.array([read_seconds, *seconds]), image=first)
    last = np.inf if max_frames is None else start + max_frames
    index, clock = start, 0.0
    while True:
        begin = now()
        late = max(0, int(clock * source.rate) - (index - start) - 1) if arrival == "live" else 0
        missed, image = source.take(late)
        read_seconds = now() - begin
        for _ in range(missed):
            index += 1
            if index >= last:
                return
            yield LiveFrame(index, row.copy(), float("nan"), np.zeros(3), is_skipped=True)
        index += 1
        if image is None or index >= last:
            return
        with name_failures(f"{source.title}, frame {index}"):
            row, score, seconds = track_frame(tracker, image)
        clock = max(clock, (index - start) / source.rate) + float(seconds.sum())
        yield LiveFrame(index, row, score, np.array([read_seconds, *seconds]), image=image)
