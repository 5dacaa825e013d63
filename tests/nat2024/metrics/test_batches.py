"""Sequences that are scored at once get what they get alone, to the last bit."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nat2024.errors import ArrayContract
from nat2024.metrics import SCORE_NAMES, Protocol, evaluate_boxes, list_protocols
from nat2024.metrics.batches import Aligned, aligned, measure_rows, pair_of, strict_success
from nat2024.metrics.scores import COUNT_NAMES, CURVE_LENGTHS, SequenceScores

PROTOCOLS = [
    *map(Protocol, list_protocols()),
    Protocol("pytracking", label="uav", exclude_invalid=True),
    Protocol("got10k-ope", invalid_rule="none"),
    Protocol("got10k-ao", frame_size=(60, 50)),
]


def boxes(rng: np.random.Generator, rows: int, odd: bool) -> np.ndarray:
    """Boxes of which many lie on thresholds; odd ones without size, outside or absent."""
    found = rng.integers(1, 40, (rows, 4)) + rng.choice([0.0, 0.5, 1 / 3], (rows, 4))
    if odd:
        found[rng.random(rows) < 0.2, 2] = 0
        found[rng.random(rows) < 0.2, 0] = -3
        found[rng.random(rows) < 0.2] = np.nan
    return found


def bits(row: np.ndarray, protocol: Protocol) -> dict[str, bytes]:
    one = SequenceScores(name="", protocol=protocol, by_frame=lambda: None, row=row)
    names = (*COUNT_NAMES, *SCORE_NAMES, *CURVE_LENGTHS)
    return {name: np.asarray(getattr(one, name)).tobytes() for name in names}


@pytest.mark.parametrize("protocol", PROTOCOLS, ids=lambda one: one.title)
@given(
    seed=st.integers(0, 2**32 - 1),
    rows=st.lists(st.integers(1, 70), min_size=1, max_size=6),
    flags=st.booleans(),
    odd=st.booleans(),
    short=st.booleans(),
)
def test_many_are_as_each_alone(protocol, seed, rows, flags, odd, short) -> None:
    rng = np.random.default_rng(seed)
    odd = odd and protocol.name != "pytracking"  # which refuses such rows
    rule = "pad" if short else None
    given: list[Aligned] = []
    for count in rows:
        truth = boxes(rng, count, odd)
        predicted = truth[: max(1, count - 2 * short)] + rng.integers(-4, 5, (1, 4))
        predicted[:, 2:] = np.where(predicted[:, 2:] < 0, 1, predicted[:, 2:])
        visible = rng.random(count) < 0.8 if flags else None
        given.append(aligned(predicted, truth, visible, protocol, rule))
    with np.errstate(all="ignore"):
        many, _ = measure_rows(given, pair_of(given, protocol))
        alone = [measure_rows([one], pair_of([one], protocol))[0][0] for one in given]
        strict = strict_success(pair_of(given, protocol))
    for row, own, value, one in zip(many, alone, strict, given, strict=True):
        assert bits(row, protocol) == bits(own, protocol)
        direct = evaluate_boxes(
            one.predicted[: one.present],
            one.truth,
            visible=one.visible,
            protocol="strict",
            on_length=rule,
        )
        np.testing.assert_equal(value, direct.success_auc)


def test_covered_frames_of_several_sequences() -> None:
    protocol = Protocol("got10k-ao", cover=[1, 1, 0, 1])
    rng = np.random.default_rng(0)
    truths = [boxes(rng, 4, odd=False) for _ in range(3)]
    given = [aligned(truth + 1, truth, None, protocol, None) for truth in truths]
    rows, _ = measure_rows(given, pair_of(given, protocol))
    for row, truth in zip(rows, truths, strict=True):
        one = evaluate_boxes(truth + 1, truth, protocol=protocol)
        assert one.frames == 2
        assert bits(row, protocol)["average_overlap"] == np.float64(one.average_overlap).tobytes()


def test_a_refused_row_is_refused_among_many() -> None:
    protocol = Protocol("pytracking")
    truth = np.full((3, 4), 9.0)
    bad = truth.copy()
    bad[1, 2] = -1
    given = [aligned(one, truth, None, protocol, None) for one in (truth, bad)]
    with pytest.raises(ArrayContract, match="row 5: NaN or negative size"):
        measure_rows(given, pair_of(given, protocol))
