"""Repeats of a run are averaged, curve by curve."""

import numpy as np
import pytest

from nat2024.errors import ArrayContract
from nat2024.metrics import SequenceScores, average_repeats, evaluate_boxes, list_protocols
from nat2024.metrics.scores import SCORE_NAMES

TRUTH = np.array([[10.0, 10, 20, 20], [12, 10, 20, 20], [14, 10, 20, 20], [16, 10, 20, 20]])


def scored(shift: float, protocol: str = "pysot") -> SequenceScores:
    moved = TRUTH + np.array([[0, 0, 0, 0], *[[shift, 0, 0, 0]] * 3])
    return evaluate_boxes(moved, TRUTH, protocol=protocol)


def test_hits_and_misses_meet_in_the_middle() -> None:
    good, bad = scored(0), scored(1000)
    mean = average_repeats([good, bad])
    # the first frame is a hit in both, the others in one of two
    assert mean.success_auc == pytest.approx((1 + 0.25) / 2 * 20 / 21)
    assert mean.precision_20 == pytest.approx(0.625)
    assert mean.overlap.tolist() == [1, 0.5, 0.5, 0.5]
    assert mean.center_error.tolist() == [0, 500, 500, 500]
    np.testing.assert_allclose(mean.success_curve, (good.success_curve + bad.success_curve) / 2)
    assert (mean.frames, mean.length_truth) == (4, 4)


# got10k-ao needs the size of the frame
@pytest.mark.parametrize("protocol", sorted({*list_protocols()} - {"got10k-ao"}))
def test_equal_repeats_change_nothing(protocol: str) -> None:
    one = scored(3.0, protocol)
    same = average_repeats([one, scored(3.0, protocol), scored(3.0, protocol)])
    for name in SCORE_NAMES:
        assert getattr(same, name) == pytest.approx(getattr(one, name), nan_ok=True)
    np.testing.assert_allclose(same.overlap, one.overlap)
    assert average_repeats([one]) is one


def test_no_repeats() -> None:
    with pytest.raises(ArrayContract, match="no repeats"):
        average_repeats([])
