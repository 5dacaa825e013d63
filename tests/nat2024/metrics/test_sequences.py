import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from nat2024.errors import ArrayContract, LengthMismatch, UsageError
from nat2024.metrics import SCORE_NAMES, Protocol, evaluate_boxes, list_protocols

TRUE = [100.0, 100.0, 20.0, 10.0]
FAR = [500.0, 500.0, 20.0, 10.0]
NAN = [np.nan] * 4
ANY = [
    *list_protocols(),
    Protocol("pytracking", label="uav"),
    Protocol("pytracking", label="lasot"),
]
titled = pytest.mark.parametrize(
    "protocol", ANY, ids=lambda p: p if isinstance(p, str) else p.title
)

some = st.one_of(st.floats(-50, 2000), st.sampled_from([0.0, -1.0, np.nan, np.inf, -np.inf, 1e300]))
rows = arrays(np.float64, st.tuples(st.integers(1, 12), st.just(4)), elements=some)


@titled
def test_shapes_and_names(protocol) -> None:
    scores = evaluate_boxes([TRUE] * 4, [TRUE] * 4, protocol=protocol, name="bike1")
    assert scores.name == "bike1"
    assert scores.success_curve.shape == (21,)
    assert scores.precision_curve.shape == scores.normalized_precision_curve.shape == (51,)
    assert scores.overlap.shape == scores.center_error.shape == (4,)
    assert list(scores.as_dict()) == list(SCORE_NAMES)
    assert all(np.isnan(value) or 0 <= value <= 1 for value in scores.as_dict().values())


@titled
@given(predicted=rows, truth=rows, flags=st.integers(0, 2**12 - 1))
def test_any_numbers_give_shares_or_a_clear_refusal(protocol, predicted, truth, flags) -> None:
    visible = (flags >> np.arange(len(truth))) % 2 == 1
    for array in (predicted, truth, visible):
        array.setflags(write=False)
    before = predicted.copy(), truth.copy()
    try:
        scores = evaluate_boxes(
            predicted, truth, visible=visible, protocol=protocol, on_length="pad"
        )
    except ArrayContract:
        assert getattr(protocol, "name", protocol) == "pytracking"
        return
    finally:
        np.testing.assert_array_equal(predicted, before[0])
        np.testing.assert_array_equal(truth, before[1])
    for curve, sign in (
        (scores.success_curve, -1),
        (scores.precision_curve, 1),
        (scores.normalized_precision_curve, 1),
    ):
        assert np.isnan(curve).all() or ((curve >= 0) & (curve <= 1)).all()
        assert np.isnan(curve).all() or (np.diff(curve) * sign >= 0).all()
    assert not (scores.center_error < 0).any()


@given(rows)
def test_the_curve_at_twenty_is_the_score(truth) -> None:
    scores = evaluate_boxes(truth[::-1], truth)
    assert scores.precision_20 == scores.precision_curve[20]
    assert scores.normalized_precision_20 == scores.normalized_precision_curve[20]
    assert scores.success_auc == pytest.approx(scores.success_curve.mean(), abs=1e-15)


def test_pysot_counts_frames_without_target_as_failed_and_hit() -> None:
    # target in 4 of 10 frames, tracked there, lost elsewhere: 4/10 of 20/21, and precision 1
    truth = [TRUE] * 4 + [[0, 0, 0, 0]] * 6
    scores = evaluate_boxes([TRUE] * 4 + [FAR] * 6, truth)
    assert scores.success_auc == pytest.approx(0.4 * 20 / 21)
    assert scores.precision_20 == 1
    assert scores.invalid_truth == 6
    np.testing.assert_array_equal(np.isnan(scores.overlap), [False] * 4 + [True] * 6)
    np.testing.assert_array_equal(np.isnan(scores.center_error), [False] * 4 + [True] * 6)


def test_otb_repeats_the_previous_row() -> None:
    # row 3 has no size, row 4 is NaN in all four: both become row 2, which is right
    predicted = [FAR, TRUE, [9, 9, 0, 5], NAN]
    scores = evaluate_boxes(predicted, [TRUE] * 4, protocol="otb")
    assert scores.success_auc == pytest.approx(20 / 21)
    assert scores.bad_results == 2
    assert np.isnan(scores.normalized_precision_20)
    # one NaN of four is no bad row for OTB, so row 4 repeats it; for LaSOT it is one
    predicted[2] = [np.nan, 100, 20, 10]
    assert evaluate_boxes(predicted, [TRUE] * 4, protocol="otb").precision_20 == 0.5
    assert evaluate_boxes(predicted, [TRUE] * 4, protocol="lasot").precision_20 == 1


@pytest.mark.parametrize("protocol", ["otb", "lasot", Protocol("pytracking", label="uav")])
def test_bad_rows_are_left_where_the_truth_is_absent(protocol) -> None:
    # row 3 is not repaired, as its truth is NaN; row 4 repeats it as it is and fails
    truth, flat = [TRUE, TRUE, NAN, TRUE], [0, 0, 0, 0]
    scores = evaluate_boxes([TRUE, TRUE, flat, flat], truth, protocol=protocol)
    assert scores.success_curve[0] == pytest.approx(2 / 4)


@pytest.mark.parametrize("protocol", ["otb", "trackingnet"])
def test_a_nan_corner_is_ignored_as_in_matlab_and_pandas(protocol) -> None:
    # of x, only the truth's edges are left: 20 x 10 shared by equal areas; the centre is unknown
    scores = evaluate_boxes([TRUE, [np.nan, 100, 20, 10]], [TRUE] * 2, protocol=protocol)
    np.testing.assert_array_equal(scores.overlap, [1, 1])
    assert scores.precision_20 == 0.5
    assert evaluate_boxes([[np.nan, 100, 20, 10]], [TRUE]).success_auc == 0


@pytest.mark.parametrize("protocol", ["otb", "lasot"])
def test_matlab_toolkits_add_epsilon_to_the_divisor(protocol) -> None:
    scores = evaluate_boxes([TRUE], [TRUE], protocol=protocol)
    assert scores.precision_20 == 1 / (1 + 2**-52) < 1


def test_got10k_adds_epsilon_to_the_union() -> None:
    # squares of 2**-26: area 2**-52, as much as the epsilon, hence one half; without area 0
    boxes = [TRUE, [0, 0, 2.0**-26, 2.0**-26], [5, 5, 0, 0]]
    scores = evaluate_boxes(boxes, boxes, protocol="got10k-ope")
    np.testing.assert_array_equal(scores.overlap[1:], [0.5, 0])
    assert evaluate_boxes(boxes[1:2], boxes[1:2]).overlap[0] == 1


def test_pysot_divides_by_a_size_that_is_never_zero() -> None:
    # a point at (4.5, 4.5): the same centre is at distance 0, one 1 px off at 1e16
    point = [5, 5, 0, 0]
    scores = evaluate_boxes([[4, 4, 2, 2], [5, 4, 2, 2]], [point] * 2)
    np.testing.assert_array_equal(scores.normalized_precision_curve, np.full(51, 0.5))
    np.testing.assert_array_equal(scores.normalized_center_error[0], 0)
    assert scores.normalized_center_error[1] == pytest.approx(1e16)


def test_a_bad_second_row_becomes_the_given_first_one_not_the_truth() -> None:
    for protocol in ("otb", "lasot", "pytracking"):
        scores = evaluate_boxes([FAR, [0, 0, 0, 0]], [TRUE] * 2, protocol=protocol)
        assert scores.precision_20 == 0.5, protocol


def test_pytracking_labels_and_options() -> None:
    # row 3: x = 0 is no target under "positive", but is under "size"
    truth = [TRUE, TRUE, [0, 100, 20, 10]]
    predicted = [TRUE, TRUE, FAR]
    precision = {
        label: evaluate_boxes(
            predicted, truth, protocol=Protocol("pytracking", label=label)
        ).precision_20
        for label in ("uav", "lasot", "night")
    }
    assert precision == pytest.approx({"uav": 1, "lasot": 2 / 3, "night": 2 / 3})
    sized = Protocol("pytracking", label="uav", invalid_rule="size")
    assert evaluate_boxes(predicted, truth, protocol=sized).precision_20 == pytest.approx(2 / 3)
    excluded = Protocol("pytracking", label="uav", exclude_invalid=True)
    scores = evaluate_boxes(predicted, truth, protocol=excluded)
    assert scores.frames == 2
    assert scores.success_auc == pytest.approx(20 / 21)
    assert scores.precision_20 == 1.5  # as in that toolkit: three passes over two frames
    assert scores.average_overlap == 1


def test_pytracking_without_a_counted_frame_has_no_score() -> None:
    protocol = Protocol("pytracking", label="uav", exclude_invalid=True)
    scores = evaluate_boxes([TRUE] * 2, [NAN] * 2, protocol=protocol)
    assert np.isnan(scores.success_auc)


def test_pytracking_names_the_row_it_refuses() -> None:
    with pytest.raises(ArrayContract, match="predicted, row 2: NaN or negative size"):
        evaluate_boxes([TRUE, [0, 0, -1, 5]], [TRUE] * 2, protocol="pytracking")
    with pytest.raises(ArrayContract, match=r'truth, row 2: .*label="uav"'):
        evaluate_boxes([TRUE] * 2, [TRUE, NAN], protocol="pytracking")
    with pytest.raises(ArrayContract, match="row 2: overlap is not a number"):
        evaluate_boxes([TRUE, [-np.inf, 0, np.inf, 5]], [TRUE] * 2, protocol="pytracking")


def test_lasot_label_fails_invisible_frames_in_normalized_precision() -> None:
    visible = [True, True, False]
    by_label = {
        label: evaluate_boxes(
            [TRUE] * 3,
            [TRUE] * 3,
            visible=visible,
            protocol=Protocol("pytracking", label=label),
        ).normalized_precision_20
        for label in ("lasot", "other")
    }
    assert by_label == pytest.approx({"lasot": 2 / 3, "other": 1})


@pytest.mark.parametrize(
    ("protocol", "success", "precision"),
    [("pysot", 0.5, 0.5), ("lasot", 0.5, 0.5), ("otb", 1, 1), ("got10k-ope", 1, 1)],
)
def test_what_flags_mean(protocol, success, precision) -> None:
    scores = evaluate_boxes([TRUE] * 2, [TRUE] * 2, visible=[1, 0], protocol=protocol)
    assert scores.success_auc == pytest.approx(success * 20 / 21)
    assert scores.precision_20 == precision


def test_got10k_ope_rules_for_nan_truth() -> None:
    truth, predicted = [TRUE, TRUE, NAN], [TRUE] * 3
    dropped = evaluate_boxes(predicted, truth, protocol="got10k-ope")
    assert (dropped.frames, dropped.precision_20) == (2, 1)
    kept = evaluate_boxes(predicted, truth, protocol=Protocol("got10k-ope", invalid_rule="none"))
    assert (kept.frames, kept.precision_20) == (3, pytest.approx(2 / 3))


# lengths ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("protocol", ["pysot", "otb", "strict", "got10k-ao"])
@pytest.mark.parametrize("given_rows", [2, 6])
def test_unequal_lengths_are_refused_with_sequence_and_both(protocol, given_rows) -> None:
    with pytest.raises(
        LengthMismatch, match=f"^bike1: result has {given_rows} rows, .* 4;"
    ) as info:
        evaluate_boxes([TRUE] * given_rows, [TRUE] * 4, protocol=protocol, name="bike1")
    assert "on_length" in str(info.value)


def test_one_row_short_has_its_own_hint() -> None:
    with pytest.raises(LengthMismatch, match=r"one row short.*first frame.*row 1"):
        evaluate_boxes([TRUE] * 3, [TRUE] * 4)


@pytest.mark.parametrize(
    ("protocol", "short", "long"),
    [
        ("lasot", None, 1),
        ("pytracking", 0.5, 1),
        (Protocol("pytracking", label="lasot"), None, 1),
        ("got10k-ope", 1, 1),
        ("trackingnet", 0.5, 1),
    ],
)
def test_lengths_as_the_toolkits_do(protocol, short, long) -> None:
    if short is None:
        with pytest.raises(LengthMismatch, match="2 rows, ground truth 4"):
            evaluate_boxes([TRUE] * 2, [TRUE] * 4, protocol=protocol)
    else:
        scores = evaluate_boxes([TRUE] * 2, [TRUE] * 4, protocol=protocol)
        assert scores.precision_20 == short
        assert (scores.length_predicted, scores.length_truth) == (2, 4)
    surplus = evaluate_boxes([TRUE] * 4 + [FAR], [TRUE] * 4, protocol=protocol)
    assert surplus.precision_20 == long


@titled
def test_padding_fails_the_missing_rows(protocol) -> None:
    scores = evaluate_boxes([TRUE] * 3, [TRUE] * 5, protocol=protocol, on_length="pad")
    counted = 2 / 4 if protocol in ("strict", "got10k-ao") else 3 / 5
    full = 1 if protocol in ("strict", "trackingnet") else 20 / 21
    if protocol == "got10k-ao":
        assert scores.average_overlap == pytest.approx(counted)
    else:
        assert scores.success_auc == pytest.approx(counted * full)
        assert scores.precision_20 == pytest.approx(counted)
    assert len(scores.overlap) == 5


@titled
def test_cutting_scores_the_shared_rows(protocol) -> None:
    for given_rows, wanted_rows in ((3, 5), (5, 3)):
        predicted, truth = [TRUE] * 3 + [FAR] * 2, [TRUE] * 5
        scores = evaluate_boxes(
            predicted[:given_rows],
            truth[:wanted_rows],
            visible=[True] * wanted_rows,
            protocol=protocol,
            on_length="cut",
        )
        assert len(scores.overlap) == 3
        assert scores.success_rate_50 == 1 or scores.precision_20 == 1


@titled
def test_error_refuses_under_every_protocol(protocol) -> None:
    with pytest.raises(LengthMismatch, match="3 rows, ground truth 5"):
        evaluate_boxes([TRUE] * 3, [TRUE] * 5, protocol=protocol, on_length="error")


def test_nothing_left_after_cutting() -> None:
    with pytest.raises(LengthMismatch, match="nothing to score"):
        evaluate_boxes([], [TRUE], on_length="cut")


# ill-formed ------------------------------------------------------------------------------------


def test_ill_formed_calls() -> None:
    with pytest.raises(ArrayContract, match="bike1: truth: no rows"):
        evaluate_boxes([], [], name="bike1")
    with pytest.raises(ArrayContract, match="predicted: shape"):
        evaluate_boxes([[1, 2, 3]], [TRUE])
    with pytest.raises(ArrayContract, match="visible: shape"):
        evaluate_boxes([TRUE], [TRUE], visible=[True, False])
    with pytest.raises(ArrayContract, match="float64"):
        evaluate_boxes([TRUE], [TRUE], visible=[0.5])
    with pytest.raises(UsageError, match="unknown on_length 'trim'; known: error, pad, cut"):
        evaluate_boxes([TRUE], [TRUE], on_length="trim")
    with pytest.raises(UsageError, match="unknown protocol"):
        evaluate_boxes([TRUE], [TRUE], protocol="vot")


def test_scores_show_what_the_protocol_defines_and_travel() -> None:
    scores = evaluate_boxes([[0, 0, 4, 4]] * 3, [[0, 0, 4, 4]] * 3, name="one")
    assert repr(scores).startswith("SequenceScores(pysot, frames=3, success_auc=0.952381, prec")
    assert "average_overlap" not in repr(scores)
    again = pickle.loads(pickle.dumps(scores))
    assert (again.name, again.as_dict().keys()) == ("one", scores.as_dict().keys())
    np.testing.assert_array_equal(again.success_curve, scores.success_curve)
    np.testing.assert_array_equal(again.overlap, [1, 1, 1])
