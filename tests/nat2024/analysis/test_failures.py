import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nat2024.analysis import choose_moments, find_failure, lost_frames
from nat2024.analysis.moments import smoothed
from nat2024.errors import ArrayContract, LengthMismatch, UsageError

NAN = np.nan


def test_a_loss_is_found_with_what_came_before_and_after() -> None:
    overlap = [1, 0.8, 0.5, 0, 0, 0, 0.3, 0.4, 0, 0]
    error = [0, 2, 4, 6, 30, 40, 8, 5, 50, 60]
    found = find_failure(overlap, error, loss_frames=3)
    assert (found.frames, found.absent, found.first_loss) == (10, 0, 3)
    assert (found.losses, found.lost, found.recoveries) == (1, 3, 1)
    assert found.drift == pytest.approx(2.0)  # 0, 2, 4
    assert (found.longest, found.longest_start) == (4, 6)  # the two zeros at the end are no loss
    assert lost_frames(overlap, loss_frames=3).nonzero()[0].tolist() == [3, 4, 5]


def test_never_lost_and_always_lost() -> None:
    never = find_failure(np.full(30, 0.7), np.arange(30.0))
    assert (never.first_loss, never.losses, never.lost, never.longest) == (None, 0, 0, 30)
    assert np.isnan(never.drift)
    always = find_failure(np.zeros(30), np.full(30, 99.0))
    assert (always.first_loss, always.lost, always.recoveries, always.longest) == (0, 30, 0, 0)
    assert always.longest_start == -1
    assert np.isnan(always.drift)


def test_frames_without_truth_neither_count_nor_break_a_loss() -> None:
    overlap = [0.9, 0, 0, NAN, NAN, 0, 0.2]
    found = find_failure(overlap, [0, 9, 9, NAN, NAN, 9, 1], loss_frames=3)
    assert (found.frames, found.absent, found.lost, found.first_loss) == (5, 2, 3, 1)
    flags = lost_frames(overlap, loss_frames=3)
    assert flags.nonzero()[0].tolist() == [1, 2, 5]


def test_an_error_that_is_not_known_does_not_spoil_the_drift() -> None:
    overlap = [1, 0.9, 0.8, 0.7] + [0] * 10
    error = [0, NAN, 6, 9] + [NAN] * 10
    assert find_failure(overlap, error).drift == pytest.approx(3.0)
    assert np.isnan(find_failure(overlap, [NAN] * 14).drift)


def test_drift_looks_only_at_the_frames_before_the_loss() -> None:
    error = np.concatenate([np.full(50, 100.0), np.arange(20) * 5.0, np.full(10, 300.0)])
    overlap = np.concatenate([np.full(70, 0.5), np.zeros(10)])
    assert find_failure(overlap, error).drift == pytest.approx(5.0)
    assert find_failure(overlap, error, drift_frames=2).drift == pytest.approx(5.0)


def test_nothing_known_and_nothing_at_all() -> None:
    for overlap in ([], [NAN, NAN]):
        found = find_failure(overlap, overlap)
        assert (found.frames, found.first_loss, found.longest) == (0, None, 0)


def test_wrong_input_is_refused() -> None:
    with pytest.raises(LengthMismatch, match="2 overlaps, but 1 centre"):
        find_failure([0, 1], [0])
    with pytest.raises(ArrayContract):
        find_failure([[0, 1]], [[0, 1]])
    with pytest.raises(UsageError, match="loss_frames"):
        find_failure([0], [0], loss_frames=0)


@given(st.lists(st.sampled_from([0.0, 0.4, NAN]), max_size=60), st.integers(1, 12))
def test_losses_and_the_rest_add_up(values: list[float], loss_frames: int) -> None:
    overlap = np.array(values, dtype=np.float64)
    found = find_failure(overlap, np.zeros(len(overlap)), loss_frames=loss_frames)
    flags = lost_frames(overlap, loss_frames=loss_frames)
    assert found.frames + found.absent == len(overlap)
    assert found.lost == flags.sum()
    assert found.lost >= found.losses * loss_frames
    assert found.losses - found.recoveries in (0, 1)
    assert found.longest <= found.frames - found.lost
    assert not np.any(overlap[flags] > 0)
    if found.first_loss is not None:
        assert flags.argmax() == found.first_loss


def test_moments_are_best_worst_gain_and_first_loss() -> None:
    plain = np.full(100, 0.6)
    plain[60:] = 0.0
    better = np.full(100, 0.6)
    better[20:30] = 0.9
    moments = choose_moments({"t": plain, "t+e": better}, [("t+e", "t")], {"t": 60, "t+e": None})
    by_reason = {reason: moment for moment in moments for reason in moment.reasons}
    assert by_reason["first loss"].row in range(57, 61)
    assert by_reason["first loss"].run == "t"
    assert by_reason["largest gain"].row >= 60
    assert by_reason["best"].row in range(22, 28)
    assert by_reason["worst"].row >= 60
    assert "largest harm" not in by_reason
    assert [m.row for m in moments] == sorted(m.row for m in moments)


def test_moments_of_nothing() -> None:
    assert choose_moments({}) == []
    assert choose_moments({"t": np.full(5, NAN)}) == []
    assert choose_moments({"t": np.array([1.0])}) == []


def test_smoothing_keeps_what_is_not_known() -> None:
    values = np.array([1.0, NAN, 0.0, 0.5])
    smooth = smoothed(values)
    assert np.isnan(smooth[1])
    assert smooth[[0, 2, 3]].tolist() == [0.5, 0.5, 0.5]
