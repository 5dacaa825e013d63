import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from nat2024_trackers.siamese.crops import SearchWindow
from nat2024_trackers.siamese.selection import cosine_window, penalties, select
from nat2024_trackers.siamese.state import Candidates, Constants, Target

CONSTANTS = Constants(
    instance_size=63,
    map_size=5,
    stride=8,
    penalty_k=0.16,
    window_influence=0.4,
    learning_rate=0.3,
    anchors=2,
)
COUNT = 50
TARGET = Target(60.0, 50.0, 20.0, 30.0)
SEARCHED = SearchWindow(side=100, scale=0.5)
FRAME = (120, 100)


def choose(scores, boxes, target=TARGET, constants=CONSTANTS):
    window = cosine_window(constants)
    found = Candidates(scores[None], boxes[None])
    [step] = select(found, [target], [SEARCHED], window, [FRAME], constants)
    return step


def still_candidates() -> tuple[np.ndarray, np.ndarray]:
    """All candidates at the centre with the target's own size, score 0.5."""
    boxes = np.tile(np.array([[0.0], [0.0], [10.0], [15.0]]), COUNT)
    return np.full(COUNT, 0.5), boxes


def slow_reference(scores, boxes, target, scale, frame, constants):
    """The rules one candidate at a time, in plain floats."""

    def change(ratio):
        return max(ratio, 1 / ratio)

    def size(width, height):
        pad = (width + height) / 2
        return math.sqrt((width + pad) * (height + pad))

    n = constants.map_size
    hanning = [0.5 - 0.5 * math.cos(2 * math.pi * i / (n - 1)) for i in range(n)]
    best, best_value, best_penalty = -1, -math.inf, 0.0
    for k in range(len(scores)):
        dx, dy, width, height = boxes[:, k]
        s = change(size(width, height) / size(target.width * scale, target.height * scale))
        r = change((target.width / target.height) / (width / height))
        penalty = math.exp(-(r * s - 1) * constants.penalty_k)
        cell = k % (n * n)
        window = hanning[cell // n] * hanning[cell % n]
        influence = constants.window_influence
        value = penalty * scores[k] * (1 - influence) + window * influence
        if value > best_value:
            best, best_value, best_penalty = k, value, penalty
    rate = best_penalty * scores[best] * constants.learning_rate
    dx, dy, width, height = boxes[:, best] / scale
    return (
        best,
        best_value,
        min(max(target.center_x + dx, 0), frame[0]),
        min(max(target.center_y + dy, 0), frame[1]),
        min(max(target.width * (1 - rate) + width * rate, 10), frame[0]),
        min(max(target.height * (1 - rate) + height * rate, 10), frame[1]),
    )


@settings(max_examples=100, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_selection_equals_the_rules_one_by_one(seed):
    random = np.random.default_rng(seed)
    scores = random.random(COUNT)
    boxes = np.concatenate([random.normal(0, 20, (2, COUNT)), random.uniform(2, 60, (2, COUNT))])
    step = choose(scores, boxes)
    expected = slow_reference(scores, boxes, TARGET, SEARCHED.scale, FRAME, CONSTANTS)
    target = step.target
    assert step.index == expected[0]
    assert step.score == scores[step.index]
    found = (step.pscore, target.center_x, target.center_y, target.width, target.height)
    assert found == pytest.approx(expected[1:], abs=1e-9)


def test_the_window_is_zero_on_its_border_and_repeats_for_each_anchor():
    window = cosine_window(CONSTANTS).reshape(2, 5, 5)
    np.testing.assert_array_equal(window[0], window[1])
    assert window[0, 2, 2] == 1
    for edge in (window[:, 0], window[:, -1], window[:, :, 0], window[:, :, -1]):
        np.testing.assert_allclose(edge, 0, atol=1e-15)


def test_an_unchanged_candidate_has_no_penalty():
    _, boxes = still_candidates()
    boxes[2, 0] *= 2
    [penalty] = penalties(boxes[None], [TARGET], [SEARCHED.scale], CONSTANTS)
    assert penalty[0] < 0.95
    np.testing.assert_allclose(penalty[1:], 1)


def test_the_guard_of_the_ratios_is_an_option():
    _, boxes = still_candidates()
    guarded = dataclasses.replace(CONSTANTS, ratio_epsilon=1e-5)
    plain = penalties(boxes[None] * 1.5, [TARGET], [SEARCHED.scale], CONSTANTS)
    other = penalties(boxes[None] * 1.5, [TARGET], [SEARCHED.scale], guarded)
    assert 0 < np.abs(plain - other).max() < 1e-5


def test_the_center_jumps_and_the_size_follows():
    scores, boxes = still_candidates()
    scores[:] = 0
    boxes[:, 12] = [4, -6, 20, 30]
    scores[12] = 1
    step = choose(scores, boxes)
    rate = math.exp(-(2 - 1) * 0.16) * 0.3
    assert step.index == 12
    assert (step.target.center_x, step.target.center_y) == (68, 38)
    assert step.target.width == pytest.approx(20 * (1 - rate) + 40 * rate)
    np.testing.assert_allclose(step.box[:2] + step.box[2:] / 2, [68, 38])


@pytest.mark.parametrize("row", [0, 1, 2, 3])
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_a_candidate_that_is_no_number_is_never_chosen(row, bad):
    scores, boxes = still_candidates()
    scores[12], boxes[row, 12] = 1.0, bad
    step = choose(scores, boxes)
    assert step.index == 37  # the same cell of the other anchor
    assert np.isfinite(step.box).all()


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_score_that_is_no_number_is_never_chosen(bad):
    scores, boxes = still_candidates()
    scores[12] = bad
    assert choose(scores, boxes).index == 37


def test_sizes_of_mixed_sign_are_never_chosen():
    scores, boxes = still_candidates()
    scores[12], boxes[2:, 12] = 1.0, (-10, 20)
    assert choose(scores, boxes).index == 37


def test_without_any_usable_candidate_the_target_stays():
    scores, boxes = still_candidates()
    step = choose(scores * np.nan, boxes)
    assert (step.target, step.score, step.index) == (TARGET, 0.0, -1)


@pytest.mark.parametrize(
    ("shift", "size", "expected"),
    [
        ((1e6, 1e6), (10, 15), (120, 100, 20, 30)),
        ((-1e6, -1e6), (10, 15), (0, 0, 20, 30)),
    ],
)
def test_the_center_is_clipped_to_the_image(shift, size, expected):
    scores, boxes = still_candidates()
    boxes[:] = np.array([*shift, *size])[:, None]
    assert dataclasses.astuple(choose(scores, boxes).target) == pytest.approx(expected)


def test_the_size_is_clipped_to_ten_pixels_and_the_image():
    scores, boxes = still_candidates()
    scores[:] = 1
    loose = dataclasses.replace(CONSTANTS, penalty_k=0.0, learning_rate=1.0)
    boxes[2:] = [[1.0], [1000.0]]
    target = choose(scores, boxes, constants=loose).target
    assert (target.width, target.height) == (10, 100)


def test_several_sequences_are_judged_as_if_alone():
    rng = np.random.default_rng(5)
    scores = rng.uniform(size=(4, COUNT)).astype(np.float32)
    boxes = rng.normal(10, 9, size=(4, 4, COUNT)).astype(np.float32)  # negative sizes among them
    scores[1, 3], boxes[2, 0, 7], scores[3] = np.nan, np.inf, np.nan
    targets = [Target(60.0 + n, 50.0 - n, 20.0 + 3 * n, 30.0 - n) for n in range(4)]
    searched = [SearchWindow(side=100 + n, scale=0.5 + 0.1 * n) for n in range(4)]
    sizes = [(120 + n, 100) for n in range(4)]
    window = cosine_window(CONSTANTS)
    together = select(Candidates(scores, boxes), targets, searched, window, sizes, CONSTANTS)
    for n in range(4):
        only = Candidates(scores[n : n + 1], boxes[n : n + 1])
        one = slice(n, n + 1)
        alone = select(only, targets[one], searched[one], window, sizes[one], CONSTANTS)
        assert alone == [together[n]]
    assert [step.index >= 0 for step in together] == [True, True, True, False]
    assert together[3].target == targets[3]
