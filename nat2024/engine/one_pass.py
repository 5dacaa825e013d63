"""One-pass evaluation of one sequence: start on the first frame's box, never reset."""

import contextlib
from collections.abc import Callable, Iterator
from typing import TypeAlias

import numpy as np

from nat2024.datasets.prefetch import AHEAD, Prefetch, prefetch
from nat2024.engine.timing import TimedEnhancer, now
from nat2024.errors import ArrayContract, DatasetIncomplete, FrameUnreadable, NatBenchError
from nat2024.interfaces import Tracker
from nat2024.store import STAGES, OnBadFrame, Track
from nat2024.types import Box, Floats, Image, Sequence

FrameCallback: TypeAlias = Callable[[], object]
"""Called after each frame, for progress."""


def track_sequence(
    tracker: Tracker,
    sequence: Sequence,
    on_frame: FrameCallback | None = None,
    *,
    on_bad_frame: OnBadFrame = "error",
    ahead: int = AHEAD,
) -> Track:
    """Track one sequence from its first box to its last frame.

    Frames are decoded ahead in a background thread; the time told for reading is what this loop
    waited for a frame, not what decoding it took. Boxes do not depend on it.

    Args:
        tracker: its enhancer may be a `TimedEnhancer`, whose time is then told apart.
        sequence: must have a box in frame 0.
        on_frame: called after each frame.
        on_bad_frame: "error" raises where a frame cannot be read; "skip" leaves the tracker as it
            is, repeats its last box and tells the frame in `Track.skipped`. The first frame is
            never skipped.
        ahead: how many frames are decoded ahead; 0 reads each when it is needed.

    Returns:
        Boxes (n, 4) in row 0 as the tracker reports its start, and seconds (n, 3).

    Raises:
        NatBenchError: a frame cannot be read, or the tracker fails; names sequence and frame.
    """
    if not len(sequence.boxes):
        msg = f"{sequence.name}: no box to start on; only sequences with annotation can be run"
        raise DatasetIncomplete(msg)
    with prefetch(sequence.frames, ahead=ahead) as images:
        return _track(tracker, sequence, images, on_frame, skip=on_bad_frame == "skip")


def _track(
    tracker: Tracker,
    sequence: Sequence,
    images: Prefetch,
    on_frame: FrameCallback | None,
    *,
    skip: bool,
) -> Track:
    boxes = np.empty((len(sequence), 4))
    seconds = np.zeros((len(sequence), len(STAGES)))
    skipped = []
    shape: tuple[int, ...] = ()
    for index in range(len(sequence)):
        start = now()
        try:
            image = images.take()
        except FrameUnreadable:
            if not (skip and index):
                raise
            boxes[index] = boxes[index - 1]
            seconds[index, 0] = now() - start
            skipped.append(index)
        else:
            shape = shape or image.shape
            where = f"frame {index + 1} of {len(sequence)}"
            first_box = None if index else sequence.boxes[0]
            waited = now() - start
            with name_failures(where, _other_size(image, shape)):
                boxes[index], _, spent = track_frame(tracker, image, first_box)
            seconds[index] = waited, *spent
        if on_frame:
            on_frame()
    return Track(boxes, seconds, tuple(skipped))


@contextlib.contextmanager
def name_failures(where: str, hint: str = "") -> Iterator[None]:
    """Tell where a tracker failed, in one line between `where` and `hint`.

    Raises:
        NatBenchError: whatever a tracker of anybody's raised.
    """
    try:
        yield
    except NatBenchError as error:
        msg = f"{where}: {error}{hint}"
        raise type(error)(msg) from error
    except (Exception, SystemExit) as error:  # a plugin may fail in any way
        told = " ".join(str(error).split())
        msg = f"{where}: {type(error).__name__}: {told}{hint}"
        raise NatBenchError(msg) from error


def track_frame(
    tracker: Tracker, image: Image, first_box: Box | None = None
) -> tuple[Box, float, Floats]:
    """Start on `first_box`, or follow where it is None.

    Returns:
        Box (4,); score, NaN for the start; seconds (2,) of enhancing and tracking.

    Raises:
        ArrayContract: the tracker's answer is no box.
    """
    timed = tracker.enhancer if isinstance(tracker.enhancer, TimedEnhancer) else None
    if timed:
        timed.take()  # what was enhanced before, to warm up, belongs to no frame
    ready = now(tracker.device)
    score = float("nan")
    given: object
    if first_box is None:
        given, score = tracker.update(image)
    else:
        given = tracker.init(image, first_box)
    done = now(tracker.device)
    box = np.asarray(given, dtype=np.float64)
    if box.shape != (4,):
        msg = f"{tracker.name} gave a box of shape {box.shape}, expected (4,)"
        raise ArrayContract(msg)
    enhance = timed.take() if timed else 0.0
    return box, float(score), np.array([enhance, done - ready - enhance])


def _other_size(image: Image, first: tuple[int, ...]) -> str:
    """What many trackers fail on: a frame of another size than the first."""
    if image.shape == first:
        return ""
    return (
        f" (this frame is {image.shape[1]}x{image.shape[0]}, the first one {first[1]}x{first[0]})"
    )
