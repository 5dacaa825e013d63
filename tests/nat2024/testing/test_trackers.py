"""A tracker that keeps every rule passes; each of its broken relatives fails the rule it breaks."""

import numpy as np
import pytest

from nat2024.cards import Card
from nat2024.errors import BrokenPlugin
from nat2024.interfaces import Tracker
from nat2024.testing import check_tracker
from nat2024.testing import trackers as suite


class Brightest(Tracker):
    """Goes to the mean position of bright pixels, a little in each frame."""

    name = "brightest"
    card = Card(title="Brightest", summary="for tests")
    box: np.ndarray | None = None

    def start(self, image, box):
        self.box = box.copy()
        return box.copy()

    def advance(self, image):
        if self.box is None:
            from nat2024.errors import UsageError

            msg = "update before init"
            raise UsageError(msg)
        rows, columns = np.nonzero(image[..., 0] > 100)
        if len(rows):
            center = self.box[:2] + self.box[2:] / 2
            self.box[:2] += 0.5 * (np.array([columns.mean(), rows.mean()]) - center)
        return self.box.copy(), 1.0


def test_a_good_tracker_passes():
    check_tracker(Brightest)


def test_a_tracker_without_a_score_passes():
    class NoScore(Brightest):
        def advance(self, image):
            return super().advance(image)[0], float("nan")

    check_tracker(NoScore)


class Float32Rows(Brightest):
    def start(self, image, box):
        return super().start(image, box).astype(np.float32)


class ListRows(Brightest):
    def advance(self, image):
        return super().advance(image)[0].tolist(), 1.0


class NoTuple(Brightest):
    def advance(self, image):
        return super().advance(image)[0]


class InfiniteScore(Brightest):
    def advance(self, image):
        return super().advance(image)[0], float("inf")


class TextScore(Brightest):
    def advance(self, image):
        return super().advance(image)[0], "good"


class NotFinite(Brightest):
    def advance(self, image):
        return super().advance(image)[0] * np.nan, 1.0


class WritesFrames(Brightest):
    def advance(self, image):
        answer = super().advance(image)
        image[0, 0] = 255 - image[0, 0]
        return answer


class WritesFirstFrame(Brightest):
    def start(self, image, box):
        image[0, 0] = 255 - image[0, 0]
        return super().start(image, box)


class WritesBox(Brightest):
    def init(self, image, box):
        row = super().init(image, box)
        if isinstance(box, np.ndarray):
            box[0] += 1
        return row


class GivesItsState(Brightest):
    def advance(self, image):
        super().advance(image)
        return self.box, 1.0


class KeepsTheFrame(Brightest):
    previous = None

    def start(self, image, box):
        self.previous = image
        return super().start(image, box)

    def advance(self, image):
        row, _ = super().advance(self.previous)
        self.previous = image
        return row, 1.0


class KeepsState(Brightest):
    moved = 0.0

    def advance(self, image):
        row, score = super().advance(image)
        self.moved += 1
        row[0] += self.moved
        return row, score


class RemembersSizes(Brightest):
    sizes: tuple = ()

    def advance(self, image):
        row, score = super().advance(image)
        self.sizes = {*self.sizes, image.shape}
        row[0] += len(self.sizes)
        return row, score


class SharesState(Brightest):
    everyone: dict = {}  # noqa: RUF012 - the fault on show

    def start(self, image, box):
        self.everyone["box"] = box.copy()
        return super().start(image, box)

    def advance(self, image):
        self.box = self.everyone.get("box")
        row, score = super().advance(image)
        self.everyone["box"] = row.copy()
        return row, score


class Random(Brightest):
    def advance(self, image):
        row, score = super().advance(image)
        return row + np.random.default_rng().normal(size=4) * [1, 1, 0, 0], score


class FailsOnTiny(Brightest):
    def start(self, image, box):
        1 / int(box[2])
        return super().start(image, box)


class FailsOnHuge(Brightest):
    def start(self, image, box):
        if box[2] > image.shape[1]:
            raise MemoryError
        return super().start(image, box)


class FailsAtTheBorder(Brightest):
    def start(self, image, box):
        row = super().start(image, box)
        return row * np.nan if box[0] < 0 else row


class LosesItself(Brightest):
    def advance(self, image):
        row, score = super().advance(image)
        return (row if image.any() else row * np.nan), score


class WantsOneSize(Brightest):
    def start(self, image, box):
        self.shape = image.shape
        return super().start(image, box)

    def advance(self, image):
        if self.box is not None and image.shape != self.shape:
            raise IndexError
        return super().advance(image)


class TakesAnyBox(Brightest):
    def init(self, image, box):
        from nat2024.images import check_image

        given = np.zeros(4)
        given[: len(box)] = np.nan_to_num(np.array(box, dtype=np.float64), posinf=5)
        return self.start(check_image(image), given)


class TakesAnyImage(Brightest):
    def update(self, image):
        return self.advance(image if image.ndim == 3 and image.size else np.zeros((4, 4, 3)))


class UpdatesBeforeInit(Brightest):
    def update(self, image):
        if self.box is None:
            return np.zeros(4), 0.0
        return super().update(image)


@pytest.mark.parametrize(
    ("cls", "check", "words"),
    [
        (Float32Rows, suite.check_answers, r"init must give a float64 array .* not float32"),
        (ListRows, suite.check_answers, r"update must give a float64 array .* not list"),
        (NoTuple, suite.check_answers, r"must give \(box, score\), not ndarray"),
        (InfiniteScore, suite.check_answers, "score must be a float, finite or NaN, not inf"),
        (TextScore, suite.check_answers, "score must be a float"),
        (NotFinite, suite.check_answers, "no box of finite numbers"),
        (WritesFrames, suite.check_inputs_untouched, "writes into frame 1"),
        (WritesFirstFrame, suite.check_inputs_untouched, "writes into frame 0"),
        (WritesBox, suite.check_inputs_untouched, "changes the start box"),
        (GivesItsState, suite.check_nothing_shared, "arrays that belong to the caller"),
        (KeepsTheFrame, suite.check_nothing_shared, "arrays that belong to the caller"),
        (KeepsState, suite.check_repeatable, "when a sequence is tracked again"),
        (Random, suite.check_repeatable, "when a sequence is tracked again"),
        (RemembersSizes, suite.check_repeatable, "after another sequence: state is left over"),
        (SharesState, suite.check_independent, "they share state"),
        (FailsOnTiny, suite.check_extreme_starts, "smaller than a pixel: ZeroDivisionError"),
        (FailsOnHuge, suite.check_extreme_starts, "larger than the image: MemoryError"),
        (FailsAtTheBorder, suite.check_extreme_starts, "no box of finite numbers"),
        (LosesItself, suite.check_leaving_target, "when the target leaves the image gives"),
        (WantsOneSize, suite.check_other_sizes, "fails on a frame of another size: IndexError"),
        (TakesAnyBox, suite.check_refusals, "accepts a start box of no area"),
        (TakesAnyImage, suite.check_refusals, "accepts a grey image of two axes"),
        (UpdatesBeforeInit, suite.check_refusals, "accepts update before init"),
    ],
)
def test_a_broken_tracker_fails(cls, check, words):
    with pytest.raises(BrokenPlugin, match=f"tracker brightest: .*{words}"):
        check(cls)
    with pytest.raises(BrokenPlugin):
        check_tracker(cls)


def test_every_check_of_the_suite_is_broken_by_some_tracker():
    marks = test_a_broken_tracker_fails.pytestmark
    broken = {check for mark in marks for _, check, _ in mark.args[1]}
    assert broken == set(suite.CHECKS)


def test_a_tracker_that_says_it_is_not_repeatable_may_be_random():
    class Honest(Random):
        card = Card(title="Random", summary="for tests", repeatable=False)

    check_tracker(Honest)


def test_something_else_than_a_tracker_is_refused():
    with pytest.raises(BrokenPlugin, match=r"gave object, no nat2024\.Tracker"):
        check_tracker(object)
