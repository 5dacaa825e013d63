"""One combination on its way through frames: one sequence at a time, or several in one batch."""

import contextlib
from collections.abc import Iterator, Mapping
from typing import Any, Protocol, TypeAlias, runtime_checkable

import numpy as np

from nat2024.engine.timing import Spent, TimedEnhancer, now
from nat2024.errors import ArrayContract, NatBenchError
from nat2024.interfaces import Tracker, enhance_frame
from nat2024.types import Box, Floats, Image

Found: TypeAlias = tuple[Box, Floats]
"""Box (4,), and seconds (2,) of enhancing and tracking."""

Start: TypeAlias = tuple[Image, Box]
"""The first frame of a sequence and the box to start on."""


@runtime_checkable
class BatchTracker(Protocol):
    """A tracker that can advance several sequences in one forward of its network."""

    def begin(self, image: Image, box: Box, /) -> tuple[Any, Any]:
        """What the first frame leaves, and the state; the tracker's own state is not touched."""
        ...

    def update_many(self, images: Any, firsts: Any, targets: Any, /) -> Any:
        """A step for each sequence, with its `box`, `score` and next state `target`."""
        ...


class Method:
    """A tracker that follows sequences by their numbers; this one takes them one by one.

    It has one state, so it can follow one sequence only at a time.

    Attributes:
        tracker: what follows.
        writes: whether it was seen to write into its frames, which nobody should.
    """

    def __init__(self, tracker: Tracker) -> None:
        self.tracker = tracker
        self.writes = False

    def start(self, frames: Mapping[int, Start]) -> dict[int, Found | NatBenchError]:
        """Start on the first frame of each sequence."""
        return {which: self._try(image, box) for which, (image, box) in frames.items()}

    def advance(self, frames: Mapping[int, Image]) -> dict[int, Found | NatBenchError]:
        """Follow into the next frame of each sequence; a failure costs its own sequence only."""
        return {which: self._try(image) for which, image in frames.items()}

    def end(self, which: int) -> None:
        """Forget a sequence."""

    def _try(self, image: Image, first_box: Box | None = None) -> Found | NatBenchError:
        try:
            with name_failures():
                box, _, seconds = track_frame(self.tracker, image, first_box)
        except NatBenchError as error:
            return error
        return box, seconds


class BatchMethod(Method):
    """A tracker with `begin` and `update_many`: all sequences advance in one forward.

    The seconds of a forward are shared out evenly among its sequences.
    """

    def __init__(self, tracker: Tracker) -> None:
        super().__init__(tracker)
        assert isinstance(tracker, BatchTracker)
        self._steps: BatchTracker = tracker
        self._firsts: dict[int, Any] = {}
        self._targets: dict[int, Any] = {}

    def start(self, frames: Mapping[int, Start]) -> dict[int, Found | NatBenchError]:
        """Start on the first frame of each sequence, one by one: crops differ in what they need."""
        found: dict[int, Found | NatBenchError] = {}
        for which, (image, box) in frames.items():
            found[which] = self._try(image, box)
            if isinstance(found[which], NatBenchError):
                continue
            try:
                with name_failures():
                    begun = self._steps.begin(self._seen(image), np.array(box, dtype=np.float64))
                    self._firsts[which], self._targets[which] = begun
            except NatBenchError as error:
                found[which] = error
        return found

    def advance(self, frames: Mapping[int, Image]) -> dict[int, Found | NatBenchError]:
        """Follow into the next frames together; where that fails, one by one to find the guilty."""
        try:
            with name_failures():
                return dict(self._together(frames))
        except NatBenchError as error:
            if len(frames) == 1:
                return dict.fromkeys(frames, error)
        found: dict[int, Found | NatBenchError] = {}
        for which, image in frames.items():
            found |= self.advance({which: image})
        return found

    def end(self, which: int) -> None:
        """Forget a sequence, whose features may lie in a device's memory."""
        self._firsts.pop(which, None)
        self._targets.pop(which, None)

    def _together(self, frames: Mapping[int, Image]) -> dict[int, Found]:
        timed, device = _timed(self.tracker), self.tracker.device
        order = list(frames)
        if timed:
            timed.take()
        ready = now(device)
        steps = self._steps.update_many(
            [self._seen(frames[which]) for which in order],
            [self._firsts[which] for which in order],
            [self._targets[which] for which in order],
        )
        passed = now(device) - ready
        spent = timed.take() if timed else Spent(0.0, 0.0)
        seconds = np.array([spent.cost, passed - spent.here]) / len(order)
        by_number = dict(zip(order, steps, strict=True))
        found = {
            which: (_box(self.tracker, step.box), seconds) for which, step in by_number.items()
        }
        self._targets |= {which: step.target for which, step in by_number.items()}
        return found

    def _seen(self, image: Image) -> Image:
        """What the tracker gets to see: the enhanced frame, where the scope is "frame"."""
        enhancer = self.tracker.enhancer
        if enhancer is None or self.tracker.scope != "frame":
            return image
        return enhance_frame(enhancer, image, self.tracker.device)


def track_frame(
    tracker: Tracker, image: Image, first_box: Box | None = None
) -> tuple[Box, float, Floats]:
    """Start on `first_box`, or follow where it is None.

    Returns:
        Box (4,); score, NaN for the start; seconds (2,) of enhancing and tracking.

    Raises:
        ArrayContract: the tracker's answer is no box.
    """
    timed = _timed(tracker)
    if timed:
        timed.take()  # what was enhanced before, to warm up, belongs to no frame
    ready = now(tracker.device)
    score = float("nan")
    given: object
    if first_box is None:
        given, score = tracker.update(image)
    else:
        given = tracker.init(image, first_box)
    passed = now(tracker.device) - ready
    box = _box(tracker, given)
    spent = timed.take() if timed else Spent(0.0, 0.0)
    return box, float(score), np.array([spent.cost, passed - spent.here])


def _timed(tracker: Tracker) -> TimedEnhancer | None:
    return tracker.enhancer if isinstance(tracker.enhancer, TimedEnhancer) else None


def _box(tracker: Tracker, given: object) -> Box:
    box = np.asarray(given, dtype=np.float64)
    if box.shape != (4,):
        msg = f"{tracker.name} gave a box of shape {box.shape}, expected (4,)"
        raise ArrayContract(msg)
    return box


@contextlib.contextmanager
def name_failures(where: str = "", hint: str = "") -> Iterator[None]:
    """Tell where a tracker failed, in one line between `where` and `hint`.

    Raises:
        NatBenchError: whatever a tracker of anybody's raised.
    """
    before = f"{where}: " if where else ""
    try:
        yield
    except NatBenchError as error:
        if not before and not hint:
            raise
        msg = f"{before}{error}{hint}"
        raise type(error)(msg) from error
    except (Exception, SystemExit) as error:  # a plugin may fail in any way
        told = " ".join(str(error).split())
        msg = f"{before}{type(error).__name__}: {told}{hint}"
        raise NatBenchError(msg) from error
