import numpy as np
import pytest

from nat2024.errors import UsageError
from nat2024.metrics import Protocol, evaluate_boxes, summarize

TRUE = [100.0, 100.0, 20.0, 10.0]
FAR = [500.0, 500.0, 20.0, 10.0]
NAN = [np.nan] * 4


def score(hits: int, frames: int, protocol="pysot"):
    return evaluate_boxes(
        [TRUE] * hits + [FAR] * (frames - hits), [TRUE] * frames, protocol=protocol
    )


def test_sequences_count_alike_whatever_their_length() -> None:
    # 1/2 of 2 frames and 2/8 of 8: the mean is 3/8, pooling would give 3/10
    mean = summarize([score(1, 2), score(2, 8)])
    assert mean.precision_20 == pytest.approx(3 / 8)
    assert mean.success_auc == pytest.approx(3 / 8 * 20 / 21)
    assert (mean.sequences, mean.scored, mean.frames) == (2, 2, 10)
    np.testing.assert_allclose(mean.precision_curve, np.full(51, 3 / 8))
    assert np.isnan(mean.average_overlap)


def test_a_single_sequence_is_its_own_mean() -> None:
    one = score(3, 7)
    mean = summarize([one])
    for name, value in one.as_dict().items():
        assert mean.as_dict()[name] == pytest.approx(value, nan_ok=True)


@pytest.mark.parametrize("protocol", ["otb", "lasot"])
def test_matlab_toolkits_drop_sequences_of_zeros_metric_by_metric(protocol) -> None:
    # no row of the second overlaps (the first is without target, so it is not saved by being
    # replaced), yet that first row passes precision: 1 of 2
    zero = evaluate_boxes([FAR] * 2, [[0, 0, 0, 0], TRUE], protocol=protocol)
    assert not zero.success_curve.any()
    mean = summarize([score(2, 2, protocol), zero])
    assert mean.success_auc == pytest.approx(20 / 21)
    assert mean.precision_20 == pytest.approx(0.75)
    assert (mean.sequences, mean.scored) == (2, 1)


def test_other_protocols_keep_sequences_of_zeros() -> None:
    assert summarize([score(2, 2), score(0, 2)]).precision_20 == 0.5


def test_scoreless_sequences_leave_the_mean() -> None:
    protocol = Protocol("got10k-ope")
    absent = evaluate_boxes([TRUE] * 2, [NAN] * 2, protocol=protocol)
    assert np.isnan(absent.success_auc)
    mean = summarize([score(1, 2, protocol), absent])
    assert mean.precision_20 == 0.5
    assert mean.scored == 1
    assert np.isnan(summarize([absent]).success_auc)


def test_frame_size_and_cover_do_not_part_sequences() -> None:
    sizes = [(100, 100), (640, 480)]
    scores = [
        evaluate_boxes([TRUE] * 2, [TRUE] * 2, protocol=Protocol("got10k-ao", frame_size=size))
        for size in sizes
    ]
    assert summarize(scores).protocol == Protocol("got10k-ao")


def test_no_sequences() -> None:
    empty = summarize([], "pysot")
    assert (empty.sequences, empty.scored, empty.frames) == (0, 0, 0)
    assert np.isnan(list(empty.as_dict().values())).all()
    assert empty.success_curve.shape == (21,)
    with pytest.raises(UsageError, match="pass the protocol"):
        summarize([])


def test_protocols_do_not_mix() -> None:
    with pytest.raises(UsageError, match="otb, pysot"):
        summarize([score(1, 2), score(1, 2, "otb")])
    with pytest.raises(UsageError, match="pysot, strict"):
        summarize([score(1, 2)], "strict")
