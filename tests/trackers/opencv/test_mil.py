import math

import numpy as np
import pytest

import nat2024
from nat2024.errors import ArrayContract, InvalidOption, UsageError
from nat2024_trackers.opencv.base import OpenCVFailure, integer_box


@pytest.fixture
def tracker():
    return nat2024.create_tracker("mil")


def test_row_0_is_the_box_as_given_and_the_size_stays(tracker, clip):
    frames, box = clip
    given = box + np.array([0.25, 0.25, 0.4, 0.3])
    np.testing.assert_array_equal(tracker.init(frames[0], given), given)
    for frame in frames[1:]:
        row, score = tracker.update(frame)
        np.testing.assert_array_equal(row[2:], [30, 54])
        assert math.isnan(score)


def test_it_follows_a_slow_target(tracker, clip):
    frames, box = clip
    tracker.init(frames[0], box)
    for frame in frames[1:]:
        row, _ = tracker.update(frame)
    assert np.abs(row[:2] - [128, 46]).max() < 15


def test_a_lost_target_keeps_the_last_box(tracker, clip):
    class Losing:
        def update(self, _image):
            return False, (0, 0, 0, 0)

    frames, box = clip
    tracker.init(frames[0], box)
    row, _ = tracker.update(frames[1])
    tracker._tracker = Losing()
    np.testing.assert_array_equal(tracker.update(frames[2])[0], row)


def test_an_error_of_opencv_becomes_one_line(tracker, clip, monkeypatch):
    def make():
        import cv2

        cv2.resize(np.zeros((0, 0, 3), np.uint8), (4, 4))

    frames, box = clip
    monkeypatch.setattr(tracker, "make", make)
    with pytest.raises(OpenCVFailure, match=r"mil: OpenCV .* stops with an error") as caught:
        tracker.init(frames[0], box)
    assert "\n" not in str(caught.value)
    with pytest.raises(UsageError):
        tracker.update(frames[0])


def test_whole_frames_are_enhanced(clip, gamma):
    frames, box = clip
    enhancer = gamma()
    tracker = nat2024.create_tracker("mil", enhancer=enhancer)
    assert tracker.scope == "frame"
    tracker.init(frames[0], box)
    tracker.update(frames[1])
    assert [tuple(batch.shape) for batch in enhancer.batches] == [(1, 3, 180, 240)] * 2


def test_crops_cannot_be_enhanced():
    with pytest.raises(InvalidOption, match="only scope=frame"):
        nat2024.create_tracker("mil", scope="patch")


def test_its_card_says_that_it_is_not_repeatable(tracker):
    assert not tracker.card.repeatable
    assert tracker.card.weights == ()


# On these OpenCV's own init stops with an error or never comes back.
@pytest.mark.parametrize(
    "box",
    [
        (40, 40, 1, 1),
        (40, 40, 3, 3),
        (0, 0, 240, 180),
        (0, 60, 240, 1),
        (-20, -15, 30, 25),
        (230, 170, 30, 25),
        (-1e9, -1e9, 3e9, 3e9),
    ],
)
def test_extreme_start_boxes(tracker, clip, box):
    frames, _ = clip
    start = tracker.start_box(frames[0], np.array(box, dtype=np.float64))
    assert min(start[:2]) >= 0
    assert min(start[2:]) >= 5
    assert start[0] + start[2] <= 238
    assert start[1] + start[3] <= 178
    tracker.init(frames[0], box)
    assert np.isfinite(tracker.update(frames[1])[0]).all()


@pytest.mark.parametrize("size", [(17, 17), (40, 17), (17, 40)])
def test_the_smallest_images(tracker, size):
    image = np.random.default_rng(0).integers(0, 256, (*size, 3), dtype=np.uint8)
    tracker.init(image, (4, 4, 6, 6))
    assert np.isfinite(tracker.update(image)[0]).all()


def test_smaller_images_are_refused(tracker):
    with pytest.raises(ArrayContract, match="at least 17 pixels a side, not 16x30"):
        tracker.init(np.zeros((30, 16, 3), dtype=np.uint8), (4, 4, 6, 6))


@pytest.mark.parametrize(
    ("box", "expected"),
    [
        ((1.5, 2.5, 3.4, 3.6), (2, 2, 3, 4)),
        ((-3.2, 9, 0.2, 0.5), (-3, 9, 1, 1)),
        ((-50, 10, 300, 20), (0, 10, 100, 20)),
        ((40, 10, 101, 20), (40, 10, 60, 20)),
        ((90, -30, 20, 60), (90, -30, 20, 60)),
        ((90, -30, 20, 110), (90, 0, 20, 80)),
    ],
)
def test_boxes_are_rounded_and_cut_where_larger_than_the_image(box, expected):
    image = np.zeros((80, 100, 3), dtype=np.uint8)
    assert integer_box(np.array(box, dtype=np.float64), image) == expected
