"""One-pass evaluation of one sequence: start on the first frame's box, never reset."""

from collections.abc import Callable
from typing import TypeAlias

from nat2024.datasets.prefetch import AHEAD
from nat2024.engine.lockstep import Reading, track_together
from nat2024.errors import NatBenchError
from nat2024.interfaces import Tracker
from nat2024.store import OnBadFrame, Track
from nat2024.types import Sequence

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

    def told(_tracker: int, _sequence: int) -> None:
        if on_frame:
            on_frame()

    [finish] = track_together([tracker], [sequence], Reading(on_bad_frame, ahead), told)
    if isinstance(finish.result, NatBenchError):
        raise finish.result
    return finish.result
