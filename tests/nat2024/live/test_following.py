"""Following through footage: every frame is told once, and slowness has its price."""

from itertools import pairwise

import numpy as np
import pytest

from nat2024.cards import Card
from nat2024.errors import UsageError
from nat2024.interfaces import Tracker
from nat2024.live import follow, following
from nat2024.live.sources import LiveSource


class Frames(LiveSource):
    """Frames whose pixels are their number."""

    title = "frames"

    def __init__(self, count, rate=30.0):
        self.count, self.rate, self.next = count, rate, 0

    def read(self):
        if self.next >= self.count:
            return None
        self.next += 1
        return np.full((24, 32, 3), self.next - 1, np.uint8)

    def skip(self, frames):
        skipped = min(frames, self.count - self.next)
        self.next += skipped
        return skipped


class Sees(Tracker):
    """Reports the number of the frame that it sees."""

    name = "sees"
    card = Card(title="Sees", summary="", scopes=("frame",))

    def start(self, image, box):
        self.seen = [int(image[0, 0, 0])]
        return box

    def advance(self, image):
        self.seen.append(int(image[0, 0, 0]))
        return np.array([self.seen[-1], 0, 5, 5], dtype=np.float64), 0.5


BOX = np.array([1.0, 2.0, 5.0, 5.0])


def test_every_frame_is_told_in_order():
    told = list(follow(Frames(7), Sees(), BOX))
    assert [frame.index for frame in told] == list(range(7))
    assert told[0].box.tolist() == BOX.tolist()
    assert np.isnan(told[0].score)
    assert [frame.box[0] for frame in told[1:]] == [1, 2, 3, 4, 5, 6]
    assert [frame.score for frame in told[1:]] == [0.5] * 6
    assert all(frame.image is not None and not frame.is_skipped for frame in told)


@pytest.mark.parametrize(
    ("start", "most", "expected"),
    [(2, None, [2, 3, 4, 5, 6]), (0, 3, [0, 1, 2]), (5, 9, [5, 6]), (6, 1, [6])],
)
def test_a_part_of_the_frames(start, most, expected):
    tracker = Sees()
    told = list(follow(Frames(7), tracker, BOX, start=start, max_frames=most))
    assert [frame.index for frame in told] == expected
    assert tracker.seen == expected


def test_a_start_beyond_the_end_is_one_line():
    with pytest.raises(UsageError, match="ends before frame 7"):
        list(follow(Frames(7), Sees(), BOX, start=7))


@pytest.fixture
def slow(monkeypatch):
    """A tracker that takes as long for each frame as is asked for."""

    def take(seconds):
        original = following.track_frame

        def timed(tracker, image, first_box=None):
            box, score, _ = original(tracker, image, first_box)
            return box, score, np.array([0.0, 0.0 if first_box is not None else seconds])

        monkeypatch.setattr(following, "track_frame", timed)

    return take


@pytest.mark.parametrize(
    ("seconds", "seen"),
    [
        (0.05, [0, 1, 2, 3, 4, 5, 6, 7, 8, 9]),  # faster than the frames come
        (0.1, [0, 1, 2, 3, 4, 5, 6, 7, 8, 9]),  # just as fast
        (0.25, [0, 1, 3, 6, 8]),  # done at 0.35, 0.6, 0.85 and 1.1 s
        (0.5, [0, 1, 6]),
        (9.0, [0, 1]),
    ],
)
def test_late_frames_are_skipped_as_a_camera_would(slow, seconds, seen):
    slow(seconds)
    tracker = Sees()
    told = list(follow(Frames(10, rate=10.0), tracker, BOX, arrival="live"))
    assert tracker.seen == seen
    assert [frame.index for frame in told] == list(range(10))
    assert [frame.index for frame in told if not frame.is_skipped] == seen
    for before, frame in pairwise(told):
        if frame.is_skipped:
            assert frame.box.tolist() == before.box.tolist()
            assert frame.image is None
            assert not frame.seconds.any()


def test_waiting_frames_are_never_skipped(slow):
    slow(9.0)
    tracker = Sees()
    list(follow(Frames(10, rate=10.0), tracker, BOX))
    assert tracker.seen == list(range(10))


def test_the_last_frames_count_when_skipped(slow):
    slow(9.0)
    told = list(follow(Frames(10, rate=10.0), Sees(), BOX, arrival="live", max_frames=4))
    assert [frame.is_skipped for frame in told] == [False, False, True, True]
