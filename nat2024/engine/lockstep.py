"""Several trackers and sequences on their way together, frame by frame.

Each frame is decoded once, whoever looks at it. A tracker that fails on a sequence leaves it, and
costs no other one anything.
"""

import contextlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from nat2024 import types
from nat2024.datasets.prefetch import AHEAD, prefetch
from nat2024.engine.methods import BatchMethod, Found, Method, name_failures
from nat2024.engine.timing import TimedEnhancer, now
from nat2024.errors import DatasetIncomplete, FrameUnreadable, NatBenchError, TimedOut
from nat2024.interfaces import Tracker
from nat2024.store import STAGES, OnBadFrame, Track
from nat2024.types import Image

FrameCallback: TypeAlias = Callable[[int, int], object]
"""Called after each frame with the number of the tracker and that of the sequence."""

_WATCHED_FRAMES = 2  # a tracker that writes into its frames does so from the start


@dataclass(frozen=True, slots=True)
class Reading:
    """How sequences are read, and when one is given up.

    Attributes:
        on_bad_frame: "error" fails a sequence where a frame cannot be read; "skip" leaves the
            tracker as it is, repeats its last box and notes the frame. The first frame is never
            skipped.
        ahead: how many frames are decoded ahead; 0 reads each when it is needed.
        timeout: seconds that a tracker may take for one sequence; None for any number.
    """

    on_bad_frame: OnBadFrame = "error"
    ahead: int = AHEAD
    timeout: float | None = None


@dataclass(frozen=True, slots=True)
class Finish:
    """What became of one tracker on one sequence.

    Attributes:
        tracker: number of the tracker.
        sequence: number of the sequence.
        result: the track, or why there is none.
    """

    tracker: int
    sequence: int
    result: Track | NatBenchError


def track_together(
    trackers: Sequence[Tracker],
    sequences: Sequence[types.Sequence],
    reading: Reading,
    on_frame: FrameCallback | None = None,
) -> Iterator[Finish]:
    """Track sequences from their first boxes to their last frames, all of them frame by frame.

    Frames are decoded ahead, in a background thread for each sequence. The seconds told for
    reading are what was waited for a frame, and count for every tracker that saw it.

    Args:
        trackers: several may share one enhancer by `SharedFrames`; put these side by side.
        sequences: more than one only where every tracker is a `BatchTracker`.
        reading: how frames are read.
        on_frame: called after each frame of each tracker.

    Yields:
        One `Finish` for each tracker and sequence, as soon as the sequence has ended.
    """
    kind = BatchMethod if len(sequences) > 1 else Method
    methods = [kind(tracker) for tracker in trackers]
    shared = [e.shared for t in trackers if isinstance(e := t.enhancer, TimedEnhancer) and e.shared]
    for frames in shared:
        frames.size = len(sequences)
    with contextlib.ExitStack() as stack:
        live = {n: _Slot(s, len(methods), reading) for n, s in enumerate(sequences)}
        for slot in live.values():
            stack.enter_context(slot)
        for index in range(max(map(len, sequences))):
            _advance(methods, index, live, on_frame)
            for frames in shared:
                frames.clear()
            for which in [n for n, slot in live.items() if slot.has_ended(index)]:
                slot = live.pop(which)
                slot.close()
                for number, trail in enumerate(slot.trails):
                    yield Finish(number, which, trail.result())


def _advance(
    methods: Sequence[Method],
    index: int,
    live: "Mapping[int, _Slot]",
    on_frame: FrameCallback | None,
) -> None:
    for slot in live.values():
        slot.read(index)
    for number, method in enumerate(methods):
        for moved in _step(method, number, index, live, watched=len(methods) > 1):
            if on_frame:
                on_frame(number, moved)


class _Trail:
    """What one tracker has done on one sequence so far."""

    def __init__(self, frames: int) -> None:
        self.boxes = np.empty((frames, 4))
        self.seconds = np.zeros((frames, len(STAGES)))
        self.skipped: list[int] = []
        self.error: NatBenchError | None = None
        self._total = 0.0

    def note(self, index: int, waited: float, found: Found) -> None:
        self.boxes[index] = found[0]
        self.seconds[index] = waited, *found[1]
        self._total += float(self.seconds[index].sum())

    def repeat(self, index: int, waited: float) -> None:
        """The frame cannot be read: the tracker stays where it is."""
        self.boxes[index] = self.boxes[index - 1]
        self.seconds[index, 0] = waited
        self.skipped.append(index)

    def check_time(self, index: int, limit: float | None) -> None:
        if limit is not None and self._total > limit and self.error is None:
            msg = f"frame {index + 1} of {len(self.boxes)}: took longer than {limit:g} s"
            self.error = TimedOut(msg)

    def result(self) -> Track | NatBenchError:
        return self.error or Track(self.boxes, self.seconds, tuple(self.skipped))


class _Slot:
    """A sequence: its frames, each read once, and the trails of all trackers that follow it."""

    def __init__(self, sequence: types.Sequence, trackers: int, reading: Reading) -> None:
        self.sequence, self.reading = sequence, reading
        self.trails = [_Trail(len(sequence)) for _ in range(trackers)]
        self.image: Image | None = None
        self.waited = 0.0
        self._shape: tuple[int, ...] = ()
        self._images = prefetch(sequence.frames, ahead=reading.ahead)

    def __len__(self) -> int:
        return len(self.sequence)

    def __enter__(self) -> "_Slot":
        self._images.__enter__()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        self._images.__exit__(None, None, None)
        self.image = None

    def read(self, index: int) -> None:
        """Take the next frame; where it cannot be read, note that in all trails."""
        start = now()
        self.image = None
        try:
            if not len(self.sequence.boxes):
                what = "no box to start on; only sequences with annotation can be run"
                msg = f"{self.sequence.name}: {what}"
                raise DatasetIncomplete(msg)
            self.image = self._images.take()
            self._shape = self._shape or self.image.shape
            self.waited = now() - start
        except FrameUnreadable as unreadable:
            if index and self.reading.on_bad_frame == "skip":
                for trail in self.trails:
                    trail.repeat(index, now() - start)
            else:
                self._fail(unreadable)
        except DatasetIncomplete as incomplete:
            self._fail(incomplete)

    def _fail(self, error: NatBenchError) -> None:
        for trail in self.trails:
            trail.error = trail.error or error

    def note(self, number: int, index: int, found: Found | NatBenchError) -> bool:
        """Keep what a tracker found; gives whether it goes on."""
        trail = self.trails[number]
        if isinstance(found, NatBenchError):
            where = f"frame {index + 1} of {len(self)}"
            try:
                with name_failures(where, self._other_size()):
                    raise found
            except NatBenchError as told:
                trail.error = told
            return False
        trail.note(index, self.waited, found)
        trail.check_time(index, self.reading.timeout)
        return trail.error is None

    def _other_size(self) -> str:
        """What many trackers fail on: a frame of another size than the first."""
        if self.image is None or self.image.shape == self._shape:
            return ""
        sizes = [f"{shape[1]}x{shape[0]}" for shape in (self.image.shape, self._shape)]
        return f" (this frame is {sizes[0]}, the first one {sizes[1]})"

    def has_ended(self, index: int) -> bool:
        return index == len(self) - 1 or all(trail.error for trail in self.trails)


def _step(
    method: Method, number: int, index: int, live: Mapping[int, _Slot], *, watched: bool
) -> Iterator[int]:
    """One frame of one tracker in every slot that it still follows; gives the slots that moved."""
    following = {which: s for which, s in live.items() if s.trails[number].error is None}
    images = {which: s.image for which, s in following.items() if s.image is not None}
    yield from following.keys() - images.keys()
    if not images:
        return
    with _own_frames(method, images, watched=watched and index < _WATCHED_FRAMES) as frames:
        if index:
            found = method.advance(frames)
        else:
            boxes = {which: live[which].sequence.boxes[0] for which in frames}
            found = method.start({which: (frames[which], boxes[which]) for which in frames})
    for which, result in found.items():
        if live[which].note(number, index, result):
            yield which


@contextlib.contextmanager
def _own_frames(
    method: Method, images: Mapping[int, Image], *, watched: bool
) -> Iterator[Mapping[int, Image]]:
    """The frames for one tracker: the shared ones, or copies for one that writes into them."""
    if method.writes:
        yield {which: image.copy() for which, image in images.items()}
        return
    before = {which: image.copy() for which, image in images.items()} if watched else {}
    yield images
    for which, untouched in before.items():
        if not np.array_equal(images[which], untouched):
            method.writes = True
            np.copyto(images[which], untouched)
