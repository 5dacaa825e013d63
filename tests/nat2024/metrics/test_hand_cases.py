"""Protocols that no kit covers, against numbers worked out by hand in the comments.

The pair used throughout: a true box (100, 100, 20, 10) and the same box 10 px to the right. They
share 10 x 10 = 100 of 200 + 200 - 100 = 300, overlap 1/3; the centres are 10 px apart; 10 px of a
width of 20 is a normalised error of 0.5.
"""

import numpy as np
import pytest

from nat2024.errors import ArrayContract, LengthMismatch
from nat2024.metrics import Protocol, evaluate_boxes, summarize

TRUE = [100.0, 100.0, 20.0, 10.0]
SHIFTED = [110.0, 100.0, 20.0, 10.0]
FAR = [500.0, 500.0, 20.0, 10.0]
NAN = [np.nan] * 4


def close(value: float):
    return pytest.approx(value, rel=0, abs=1e-12)


# TrackingNet -----------------------------------------------------------------------------------


def test_trackingnet_gives_a_perfect_tracker_one() -> None:
    # overlap 1 >= 1 passes all 21 thresholds, error 0 passes all: every area is 1
    scores = evaluate_boxes([TRUE] * 3, [TRUE] * 3, protocol="trackingnet")
    assert scores.success_auc == scores.precision_auc == scores.normalized_precision_auc == 1


def test_trackingnet_areas_are_trapezoids() -> None:
    # Row 1 passes all. Row 2, overlap 1/3, passes 0, 0.05, ..., 0.30: seven thresholds. The curve
    # is 1 seven times, then 0.5 fourteen times: of 20 intervals six are 1, one between them is
    # 0.75, thirteen are 0.5: (6 + 0.75 + 6.5) / 20 = 0.6625.
    # Precision over 0, 2.5, ..., 50: 10 px passes from the fifth on. 0.5 four times, then 1:
    # intervals 3 x 0.5 + 0.75 + 16 x 1 = 18.25, / 20 = 0.9125.
    # Normalised over 0, 0.025, ..., 0.5: 0.5 passes only the last: 19 x 0.5 + 0.75 = 10.25, / 20.
    scores = evaluate_boxes([TRUE, SHIFTED], [TRUE, TRUE], protocol="trackingnet")
    assert scores.success_auc == close(0.6625)
    assert scores.precision_auc == close(0.9125)
    assert scores.normalized_precision_auc == close(0.5125)
    assert scores.precision_20 == 1
    np.testing.assert_array_equal(scores.success_curve, [1] * 7 + [0.5] * 14)


def test_trackingnet_rounds_all_boxes() -> None:
    # 10.4 -> 10, 9.6 -> 10, 9.7 -> 10; halves go to the even number: 10.5 -> 10, 11.5 -> 12.
    # Unrounded the overlaps would be below 1 and fail threshold 1.
    truth = [[10, 10, 10, 10], [10, 10, 10, 10], [12.4, 10, 10, 10]]
    predicted = [[0, 0, 1, 1], [10.4, 9.6, 10.5, 9.7], [11.5, 10, 10, 10]]
    assert evaluate_boxes(predicted, truth, protocol="trackingnet").success_auc == 1


def test_trackingnet_replaces_the_first_row() -> None:
    # row 1 is far off, but counts as the truth: 2 of 2 frames pass everything
    scores = evaluate_boxes([FAR, TRUE], [TRUE, TRUE], protocol="trackingnet")
    assert scores.success_auc == scores.precision_auc == 1


def test_trackingnet_passes_no_overlap_at_threshold_zero() -> None:
    # overlap 0 >= 0: the curve is 1, then 0.5 twenty times: (0.75 + 19 x 0.5) / 20 = 0.5125
    scores = evaluate_boxes([TRUE, FAR], [TRUE, TRUE], protocol="trackingnet")
    assert scores.success_auc == close(0.5125)
    assert scores.precision_auc == close(0.5)  # 565 px fails all: 0.5 throughout


def test_trackingnet_fails_missing_rows_and_drops_surplus_ones() -> None:
    # one row for four frames: the replaced first passes all, three NaN rows fail all, even overlap
    # 0 >= 0: 0.25 throughout
    scores = evaluate_boxes([FAR], [TRUE] * 4, protocol="trackingnet")
    assert scores.success_auc == scores.precision_auc == close(0.25)
    assert scores.normalized_precision_auc == close(0.25)
    surplus = evaluate_boxes([TRUE, TRUE, FAR], [TRUE, TRUE], protocol="trackingnet")
    assert surplus.success_auc == 1


def test_trackingnet_divides_the_difference_of_centers() -> None:
    # 7 px of a width of 14 is 0.5 and passes the last threshold; dividing each centre first, as
    # other toolkits do, gives 0.5000000000000009 and fails
    truth, predicted = [[100, 100, 14, 10]] * 2, [[100, 100, 14, 10], [107, 100, 14, 10]]
    scores = evaluate_boxes(predicted, truth, protocol="trackingnet")
    assert scores.normalized_precision_curve[50] == 1
    assert evaluate_boxes(predicted, truth, protocol="lasot").normalized_precision_curve[50] < 0.6


def test_trackingnet_knows_no_absent_frames() -> None:
    # a NaN truth compares false everywhere and stays in the divisor: 1 of 2 frames
    scores = evaluate_boxes([TRUE, TRUE], [TRUE, NAN], protocol="trackingnet")
    assert scores.success_auc == scores.precision_auc == close(0.5)


# GOT-10k itself --------------------------------------------------------------------------------


def test_got10k_ao_of_a_perfect_tracker_is_one() -> None:
    # the first of three rows is dropped; 1 > 0.5 and 1 > 0.75
    scores = evaluate_boxes([TRUE] * 3, [TRUE] * 3, protocol="got10k-ao")
    assert scores.average_overlap == close(1)
    assert scores.success_rate_50 == scores.success_rate_75 == 1
    assert scores.frames == 2
    assert np.isnan([scores.success_auc, scores.precision_20, scores.normalized_precision_20]).all()
    assert np.isnan(scores.precision_curve).all()


def test_got10k_ao_averages_the_overlap_after_the_first_row() -> None:
    # overlaps 1/3 and, 10 x 6 of 10 x 10, 0.6: mean 7/15; one of two above 0.5, none above 0.75
    truth = [TRUE, TRUE, [0, 0, 10, 10]]
    predicted = [FAR, SHIFTED, [0, 0, 10, 6]]
    scores = evaluate_boxes(predicted, truth, protocol="got10k-ao")
    assert scores.average_overlap == close(7 / 15)
    assert scores.success_rate_50 == 0.5
    assert scores.success_rate_75 == 0


def test_got10k_ao_leaves_out_covered_frames() -> None:
    # row 1 is dropped, row 2 has cover 0: only row 3 with overlap 1/3 is left
    protocol = Protocol("got10k-ao", cover=[8, 0, 3])
    scores = evaluate_boxes([TRUE, FAR, SHIFTED], [TRUE] * 3, protocol=protocol)
    assert scores.average_overlap == close(1 / 3)
    assert scores.frames == 1
    np.testing.assert_array_equal(np.isnan(scores.overlap), [True, True, False])
    with pytest.raises(ArrayContract, match="cover: 3 values for 2 rows"):
        evaluate_boxes([TRUE] * 2, [TRUE] * 2, protocol=protocol)


def test_got10k_ao_clips_both_boxes_to_the_frame() -> None:
    # Right and below: (90, 90, 20, 20) in a frame of 100 x 100 becomes (90, 90, 10, 10), as is the
    # result: overlap 1. Left: the corner of (-10, 0, 20, 10) moves to 0 and the width stays 20, a
    # quirk of the toolkit; with (0, 0, 10, 10) 100 / 200 = 0.5. A true cut would leave
    # (0, 0, 10, 10) and give 1.
    truth = [TRUE, [90, 90, 20, 20], [-10, 0, 20, 10]]
    predicted = [TRUE, [90, 90, 10, 10], [0, 0, 10, 10]]
    clipped = evaluate_boxes(
        predicted, truth, protocol=Protocol("got10k-ao", frame_size=(100, 100))
    )
    np.testing.assert_allclose(clipped.overlap[1:], [1, 0.5], rtol=0, atol=1e-12)
    assert clipped.average_overlap == close(0.75)
    # Unclipped: 100 of 400; and x from 0 to 10 shared, 100 of 200 + 100 - 100.
    unclipped = evaluate_boxes(predicted, truth, protocol="got10k-ao")
    np.testing.assert_allclose(unclipped.overlap[1:], [0.25, 0.5], rtol=0, atol=1e-12)


def test_got10k_ao_pools_the_frames_of_all_sequences() -> None:
    # A: one counted frame, overlap 1. B: three counted, overlaps 0, 0, 0.6.
    # Pooled (1 + 0 + 0 + 0.6) / 4 = 0.4; the mean of sequences would be (1 + 0.2) / 2 = 0.6.
    # Above 0.5: 2 of 4; above 0.75: 1 of 4.
    a = evaluate_boxes([TRUE] * 2, [TRUE] * 2, protocol="got10k-ao")
    b = evaluate_boxes(
        [TRUE, FAR, FAR, [0, 0, 10, 6]], [TRUE] * 3 + [[0, 0, 10, 10]], protocol="got10k-ao"
    )
    pooled = summarize([a, b])
    assert pooled.average_overlap == close(0.4)
    assert pooled.success_rate_50 == close(0.5)
    assert pooled.success_rate_75 == close(0.25)
    assert pooled.frames == 4
    assert np.isnan(pooled.success_auc)


def test_got10k_ao_takes_flags_and_fails_bad_rows() -> None:
    # row 2 is a NaN result: overlap 0; row 3 invisible: left out; row 4: 1. Mean of 0 and 1.
    predicted = [TRUE, NAN, FAR, TRUE]
    scores = evaluate_boxes(
        predicted, [TRUE] * 4, visible=[True, True, False, True], protocol="got10k-ao"
    )
    assert scores.average_overlap == close(0.5)
    assert scores.frames == 2


def test_got10k_ao_leaves_out_nan_truth_and_refuses_unequal_lengths() -> None:
    # without cover and flags a NaN row is an absent target: row 3 alone, overlap 1/3
    scores = evaluate_boxes([TRUE, TRUE, SHIFTED], [TRUE, NAN, TRUE], protocol="got10k-ao")
    assert scores.average_overlap == close(1 / 3)
    with pytest.raises(LengthMismatch, match="2 rows, ground truth 4"):
        evaluate_boxes([TRUE] * 2, [TRUE] * 4, protocol="got10k-ao")


# strict ----------------------------------------------------------------------------------------


def test_strict_gives_a_perfect_tracker_exactly_one() -> None:
    # values for which x + w - x differs from w: a rounded overlap would fail threshold 1
    boxes = [TRUE, [0.1, 0.7, 0.2, 0.3], [1e6 + 0.1, 3.3, 0.1, 7.7], [-5.55, -0.3, 11.1, 0.9]]
    scores = evaluate_boxes(boxes, boxes, protocol="strict")
    assert scores.success_auc == scores.precision_20 == 1
    assert scores.normalized_precision_20 == scores.normalized_precision_auc == 1
    assert scores.frames == 3


def test_strict_leaves_out_the_first_frame() -> None:
    # Only row 2 counts. Overlap 1/3 passes 7 of 21: 1/3. 10 px is within 20. A normalised error of
    # 0.5 is beyond 0.20 and passes only the last of 51 thresholds: 1/51.
    scores = evaluate_boxes([TRUE, SHIFTED], [TRUE, TRUE], protocol="strict")
    assert scores.success_auc == close(1 / 3)
    assert scores.precision_20 == 1
    assert scores.normalized_precision_20 == 0
    assert scores.normalized_precision_auc == close(1 / 51)


def test_strict_takes_frames_without_target_out_of_both_sides() -> None:
    # Rows 3 (NaN), 4 (no width) and 5 (infinite) leave; rows 2 (perfect) and 6 (no overlap) count.
    # Success: 1 at threshold 0 (0 >= 0), then 0.5 twenty times: 11/21. The rest 1 of 2.
    truth = [TRUE, TRUE, NAN, [5, 5, 0, 5], [5, np.inf, 5, 5], TRUE]
    predicted = [TRUE, TRUE, TRUE, TRUE, TRUE, FAR]
    scores = evaluate_boxes(predicted, truth, protocol="strict")
    assert scores.frames == 2
    assert scores.success_auc == close(11 / 21)
    assert scores.precision_20 == scores.normalized_precision_20 == 0.5
    assert scores.invalid_truth == 3


@pytest.mark.parametrize("bad", [NAN, [100, 100, np.inf, 10], [np.nan, 100, 20, 10]])
def test_strict_fails_bad_result_rows_even_at_threshold_zero(bad) -> None:
    # rows 2 (perfect) and 3 (bad) count: 0.5 at every threshold of every curve
    scores = evaluate_boxes([TRUE, TRUE, bad], [TRUE] * 3, protocol="strict")
    assert scores.success_auc == close(0.5)
    assert scores.precision_20 == scores.normalized_precision_auc == close(0.5)
    assert scores.bad_results == 1


def test_strict_has_no_score_without_a_counted_frame() -> None:
    # one frame alone is the first; absent ones never count
    for truth in ([TRUE], [TRUE, NAN], [NAN] * 3):
        scores = evaluate_boxes([TRUE] * len(truth), truth, protocol="strict")
        assert scores.frames == 0
        assert np.isnan([scores.success_auc, scores.precision_20]).all()
        assert np.isnan(scores.normalized_precision_curve).all()


def test_strict_leaves_out_invisible_frames() -> None:
    # row 3 is wrong but invisible: only row 2, perfect, counts
    scores = evaluate_boxes(
        [TRUE, TRUE, FAR], [TRUE] * 3, visible=[True, True, False], protocol="strict"
    )
    assert scores.frames == 1
    assert scores.success_auc == 1


@pytest.mark.parametrize("bad", [[0, 0, 0, 0], [300, 100, -20, 10]])
def test_strict_counts_a_result_without_size_as_no_overlap(bad) -> None:
    # Overlap 0 passes threshold 0 only: 1/21. Centres are 151 and 180 px away. The areas 200 and
    # -20 x 10 would make a union of 0.
    scores = evaluate_boxes([TRUE, bad], [TRUE, TRUE], protocol="strict")
    assert scores.success_auc == close(1 / 21)
    assert scores.precision_20 == 0


def test_strict_passes_values_on_the_threshold() -> None:
    # 10 x 5 of 10 x 10 is 0.5 and passes 0, 0.05, ..., 0.5: 11 of 21
    truth, predicted = [[0, 0, 10, 10]] * 2, [[0, 0, 10, 10], [0, 0, 10, 5]]
    assert evaluate_boxes(predicted, truth, protocol="strict").success_auc == close(11 / 21)
    # pysot counts both rows: 1 passes 20, 0.5 > 0.5 is false, so 10: (20 + 10) / 2 / 21
    assert evaluate_boxes(predicted, truth).success_auc == close(15 / 21)


def test_strict_leaves_scoreless_sequences_out_of_the_mean() -> None:
    # 1 and 1/3 are averaged, the third has no counted frame: 2/3
    perfect = evaluate_boxes([TRUE] * 2, [TRUE] * 2, protocol="strict")
    poor = evaluate_boxes([TRUE, SHIFTED], [TRUE] * 2, protocol="strict")
    none = evaluate_boxes([TRUE] * 2, [TRUE, NAN], protocol="strict")
    mean = summarize([perfect, poor, none])
    assert mean.success_auc == close(2 / 3)
    assert (mean.sequences, mean.scored, mean.frames) == (3, 2, 2)
