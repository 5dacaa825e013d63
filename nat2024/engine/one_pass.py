"""One-pass evaluation of one sequence: start on the first frame's box, never reset."""

from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from nat2024.engine.timing import TimedEnhancer, now
from nat2024.errors import DatasetIncomplete, NatBenchError
from nat2024.interfaces import Tracker
from nat2024.store import STAGES, Track
from nat2024.types import Sequence

FrameCallback: TypeAlias = Callable[[], object]
"""Called after each frame, for progress."""


def track_sequence(
    tracker: Tracker, sequence: Sequence, on_frame: FrameCallback | None = None
) -> Track:
    """Track one sequence from its first box to its last frame.

    Args:
        tracker: its enhancer may be a `TimedEnhancer`, whose time is then told apart.
        sequence: must have a box in frame 0.
        on_frame: called after each frame.

    Returns:
        Boxes (n, 4) in row 0 as the tracker reports its start, and seconds (n, 3).

    Raises:
        NatBenchError: a frame cannot be read, or the tracker fails; names sequence and frame.
    """
    if not len(sequence.boxes):
        msg = f"{sequence.name}: no box to start on; only sequences with annotation can be run"
        raise DatasetIncomplete(msg)
    boxes = np.empty((len(sequence), 4))
    seconds = np.empty((len(sequence), len(STAGES)))
    timed = tracker.enhancer if isinstance(tracker.enhancer, TimedEnhancer) else None
    for index in range(len(sequence)):
        start = now()
        image = sequence.image(index)
        ready = now(tracker.device)
        try:
            boxes[index] = (
                tracker.update(image)[0] if index else tracker.init(image, sequence.boxes[0])
            )
        except NatBenchError as error:
            msg = f"frame {index + 1} of {len(sequence)}: {error}"
            raise type(error)(msg) from error
        except Exception as error:  # a plugin may fail in any way; the frame helps to find it
            msg = f"frame {index + 1} of {len(sequence)}: {type(error).__name__}: {error}"
            raise NatBenchError(msg) from error
        done = now(tracker.device)
        enhance = timed.take() if timed else 0.0
        seconds[index] = ready - start, enhance, done - ready - enhance
        if on_frame:
            on_frame()
    return Track(boxes, seconds)
