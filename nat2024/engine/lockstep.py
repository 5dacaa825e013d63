"""Several trackers and sequences on their way together, frame by frame.

Sequences go in lanes. Each frame is decoded once, whoever looks at it. A tracker that fails on a
sequence leaves it, and costs no other one anything.
"""

import contextlib
from collections import deque
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

_READERS = 4
"""Threads that decode, where lanes do not make it more: a GPU is faster than one of them."""

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
    *,
    lanes: int = 1,
) -> Iterator[Finish]:
    """Track sequences from their first boxes to their last frames, some of them frame by frame.

    A sequence that ends, or that no tracker follows any more, leaves its lane to the next one, so
    that batches stay full to the last few sequences. Frames are decoded ahead, in
    background threads. The seconds told for reading are what was waited for a frame, and count
    for every tracker that saw it.

    Args:
        trackers: several may share one enhancer by `SharedFrames`; put these side by side.
        sequences: begun in this order; the longest first leaves least to wait for at the end.
        reading: how frames are read.
        on_frame: called after each frame of each tracker.
        lanes: how many sequences advance at once; more than one only where every tracker is a
            `BatchTracker`.

    Yields:
        One `Finish` for each tracker and sequence, as soon as the sequence has ended.
    """
    kind = BatchMethod if min(lanes, len(sequences)) > 1 else Method
    methods = [kind(tracker) for tracker in trackers]
    shared = [e.shared for t in trackers if isinstance(e := t.enhancer, TimedEnhancer) and e.shared]
    for frames in shared:
        frames.size = lanes
    readers = max(1, _READERS // lanes)
    waiting = deque(enumerate(sequences))
    live: dict[int, _Lane] = {}
    try:
        while waiting or live:
            begun: dict[int, _Lane] = {}
            while waiting and len(live) < lanes:
                number, sequence = waiting.popleft()
                begun[number] = live[number] = _Lane(sequence, len(methods), reading, readers)
            # Those that begin catch up before the others go on, so that batches are full.
            moving = begun or dict(live)
            _advance(methods, moving, on_frame)
            for frames in shared:
                frames.clear()
            for which in [number for number, lane in moving.items() if lane.has_ended]:
                lane = live.pop(which)
                lane.close()
                for number, method in enumerate(methods):
                    method.end(which)
                    yield Finish(number, which, lane.trails[number].result())
    finally:
        for lane in live.values():
            lane.close()


def _advance(
    methods: Sequence[Method], lanes: "Mapping[int, _Lane]", on_frame: FrameCallback | None
) -> None:
    """One frame of all trackers in these lanes, of which all begin or none does."""
    for lane in lanes.values():
        lane.read()
    for number, method in enumerate(methods):
        for moved in _step(method, number, lanes, watched=len(methods) > 1):
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


class _Lane:
    """A sequence on its way: its frames, each read once, and the trails of all its trackers."""

    def __init__(
        self, sequence: types.Sequence, trackers: int, reading: Reading, readers: int
    ) -> None:
        self.sequence, self.reading = sequence, reading
        self.trails = [_Trail(len(sequence)) for _ in range(trackers)]
        self.index = -1  # of the frame that was read last
        self.image: Image | None = None
        self.waited = 0.0
        self._shape: tuple[int, ...] = ()
        self._images = prefetch(sequence.frames, ahead=reading.ahead, threads=readers)
        self._images.__enter__()

    def __len__(self) -> int:
        return len(self.sequence)

    def close(self) -> None:
        self._images.__exit__(None, None, None)
        self.image = None

    def read(self) -> None:
        """Take the next frame; where it cannot be read, note that in all trails."""
        start = now()
        self.index += 1
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
            if self.index and self.reading.on_bad_frame == "skip":
                for trail in self.trails:
                    trail.repeat(self.index, now() - start)
            else:
                self._fail(unreadable)
        except DatasetIncomplete as incomplete:
            self._fail(incomplete)

    def _fail(self, error: NatBenchError) -> None:
        for trail in self.trails:
            trail.error = trail.error or error

    def note(self, number: int, found: Found | NatBenchError) -> bool:
        """Keep what a tracker found; gives whether it goes on."""
        trail = self.trails[number]
        if isinstance(found, NatBenchError):
            where = f"frame {self.index + 1} of {len(self)}"
            try:
                with name_failures(where, self._other_size()):
                    raise found
            except NatBenchError as told:
                trail.error = told
            return False
        trail.note(self.index, self.waited, found)
        trail.check_time(self.index, self.reading.timeout)
        return trail.error is None

    def _other_size(self) -> str:
        """What many trackers fail on: a frame of another size than the first."""
        if self.image is None or self.image.shape == self._shape:
            return ""
        sizes = [f"{shape[1]}x{shape[0]}" for shape in (self.image.shape, self._shape)]
        return f" (this frame is {sizes[0]}, the first one {sizes[1]})"

    @property
    def has_ended(self) -> bool:
        return self.index == len(self) - 1 or all(trail.error for trail in self.trails)


def _step(
    method: Method, number: int, lanes: Mapping[int, _Lane], *, watched: bool
) -> Iterator[int]:
    """One frame of one tracker in every lane that it still follows; gives those that moved."""
    following = {which: lane for which, lane in lanes.items() if lane.trails[number].error is None}
    images = {which: lane.image for which, lane in following.items() if lane.image is not None}
    yield from following.keys() - images.keys()
    if not images:
        return
    fresh = [which for which in images if watched and lanes[which].index < _WATCHED_FRAMES]
    with _own_frames(method, images, fresh) as frames:
        if all(lanes[which].index for which in frames):
            found = method.advance(frames)
        else:
            boxes = {which: lanes[which].sequence.boxes[0] for which in frames}
            found = method.start({which: (frames[which], boxes[which]) for which in frames})
    for which, result in found.items():
        if lanes[which].note(number, result):
            yield which


@contextlib.contextmanager
def _own_frames(
    method: Method, images: Mapping[int, Image], watched: Sequence[int]
) -> Iterator[Mapping[int, Image]]:
    """The frames for one tracker: the shared ones, or copies for one that writes into them."""
    if method.writes:
        yield {which: image.copy() for which, image in images.items()}
        return
    before = {which: images[which].copy() for which in watched}
    yield images
    for which, untouched in before.items():
        if not np.array_equal(images[which], untouched):
            method.writes = True
            np.copyto(images[which], untouched)
