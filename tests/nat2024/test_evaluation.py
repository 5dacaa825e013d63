"""Scoring a results folder."""

from pathlib import Path

import numpy as np
import pytest

import nat2024
from nat2024.errors import DatasetNotFound, LengthMismatch
from nat2024.evaluation import SCORES
from nat2024.metrics import list_protocols, summarize
from nat2024.types import Dataset, Sequence


class Frames:
    """Frames that nobody looks at."""

    frame_size = (100, 100)

    def __init__(self, count: int) -> None:
        self.count = count

    def __len__(self) -> int:
        return self.count

    def __getitem__(self, index: int) -> np.ndarray:
        raise IndexError(index)


def sequence(name: str, boxes: np.ndarray, **more: object) -> Sequence:
    return Sequence(name, Frames(len(boxes)), boxes, **more)  # type: ignore[arg-type]


LEFT = np.array([[0, 0, 10, 10], [10, 0, 10, 10], [20, 0, 10, 10], [30, 0, 10, 10]], dtype=float)
SHORT = LEFT[:2] + np.array([40, 40, 0, 0])


@pytest.fixture
def dataset() -> Dataset:
    short = sequence("short", SHORT, attributes=frozenset({"IV"}))
    long = sequence("long", LEFT, attributes=frozenset({"IV", "FM"}))
    return Dataset("clip", (long, short), attribute_names=("FM", "IV", "LR"))


@pytest.fixture
def results(tmp_path: Path) -> Path:
    folder = tmp_path / "clip"
    for run, shift in (("mil", 30.0), ("mil+gamma@soft", 0.0)):
        nat2024.write_boxes(folder / run / "long.txt", LEFT)
        nat2024.write_boxes(folder / run / "short.txt", SHORT + np.array([shift, 0, 0, 0]))
    return tmp_path


def test_summary(results: Path, dataset: Dataset) -> None:
    frame = nat2024.evaluate(results, dataset).summary()
    assert list(frame.columns) == [
        *("dataset", "run", "tracker", "enhancer", "scope", "protocol", "sequences", "frames"),
        *SCORES,
    ]
    plain, soft = frame.to_dict(orient="records")
    assert (plain["tracker"], plain["enhancer"]) == ("mil", "none")
    assert (soft["tracker"], soft["enhancer"]) == ("mil", "gamma@soft")
    assert (plain["sequences"], plain["frames"]) == (2, 6)
    # `long` is perfect, 20 of 21 thresholds; `short` has no overlap and its centre is 30 px off
    assert plain["success_auc"] == pytest.approx(20 / 21 / 2, abs=1e-15)
    assert plain["precision_20"] == 0.5
    assert soft["success_auc"] == pytest.approx(20 / 21, abs=1e-15)
    assert soft["precision_20"] == 1.0
    assert soft["normalized_precision_20"] == 1.0


def test_per_sequence_and_per_attribute(results: Path, dataset: Dataset) -> None:
    evaluation = nat2024.evaluate(results, dataset)
    sequences = evaluation.per_sequence().set_index(["run", "sequence"]).precision_20
    assert sequences["mil", "long"] == 1.0
    assert sequences["mil", "short"] == 0.0
    attributes = evaluation.per_attribute()
    assert set(attributes.provenance) == {"published"}
    by = attributes.set_index(["run", "attribute"])
    assert list(by.loc["mil"].index) == ["FM", "IV"]  # no sequence carries LR
    assert by.loc[("mil", "FM"), "precision_20"] == 1.0
    assert by.loc[("mil", "IV"), "precision_20"] == 0.5
    assert by.loc[("mil", "IV"), "sequences"] == 2


def test_attributes_say_where_they_come_from(results: Path) -> None:
    both, carried = frozenset({"FM", "UL", "IV"}), {"FM": "computed", "UL": "computed"}
    long = sequence("long", LEFT, attributes=both, provenance=carried)
    short = sequence("short", SHORT, attributes=both, provenance={"UL": "manual", "FM": "computed"})
    dataset = Dataset("clip", (long, short), attribute_names=("FM", "IV", "UL"))
    table = nat2024.evaluate(results, dataset).per_attribute()
    by = table.drop_duplicates("attribute").set_index("attribute").provenance
    assert by.to_dict() == {"FM": "computed", "IV": "published", "UL": "mixed"}


def test_curves(results: Path, dataset: Dataset) -> None:
    curves = nat2024.evaluate(results, dataset).curves()
    assert list(curves.columns) == ["run", "metric", "threshold", "value"]
    counts = curves.groupby(["run", "metric"]).size()
    assert counts["mil", "success"] == 21
    assert counts["mil", "precision"] == counts["mil", "normalized_precision"] == 51
    precision = curves[(curves.run == "mil") & (curves.metric == "precision")]
    assert precision.value.tolist() == [0.5] * 30 + [1.0] * 21
    assert precision.threshold.tolist() == list(range(51))


def test_protocols_differ_as_they_should(results: Path, dataset: Dataset) -> None:
    strict = nat2024.evaluate(results, dataset, protocol="strict").summary()
    assert strict.protocol.tolist() == ["strict", "strict"]
    assert strict.success_auc[1] == 1.0
    same = nat2024.evaluate(results, dataset, protocol="snot").summary()
    assert same.success_auc[1] == pytest.approx(20 / 21)


def test_a_large_difference_to_strict_is_noted(results: Path, dataset: Dataset) -> None:
    notes = nat2024.evaluate(results, dataset).notes()
    assert notes["strict_success_auc"]["mil+gamma@soft"] == 1.0


def test_what_is_missing_is_noted(results: Path, dataset: Dataset) -> None:
    (results / "clip" / "mil" / "short.txt").unlink()
    evaluation = nat2024.evaluate(results, dataset)
    assert evaluation.notes()["missing_sequences"] == {"mil": ["short"]}
    assert "mil: no result of 1 sequence, short" in evaluation.remarks()
    assert evaluation.summary().sequences.tolist() == [1, 2]


def test_boxes_on_some_frames_only_are_scored_there(tmp_path: Path) -> None:
    truth = np.full((4, 4), np.nan)
    truth[[0, 2]] = LEFT[[0, 2]]
    keyed = sequence("keyed", truth, keyframes=np.array([0, 2]))
    predicted = LEFT.copy()
    predicted[[1, 3]] = 999.0  # nobody knows the truth there
    nat2024.write_boxes(tmp_path / "clip" / "mil" / "keyed.txt", predicted)
    evaluation = nat2024.evaluate(tmp_path, Dataset("clip", (keyed,)))
    (row,) = evaluation.summary().to_dict(orient="records")
    assert row["frames"] == 2
    assert row["precision_20"] == 1.0
    nat2024.write_boxes(tmp_path / "clip" / "mil" / "keyed.txt", predicted[:3])
    with pytest.raises(LengthMismatch, match=r"keyed\.txt: 3 rows, but the sequence has 4 frames"):
        nat2024.evaluate(tmp_path, Dataset("clip", (keyed,)))


def test_sequences_without_any_box_are_not_scored(results: Path, dataset: Dataset) -> None:
    empty = Sequence("empty", Frames(3), np.empty((0, 4)))
    nat2024.write_boxes(results / "clip" / "mil" / "empty.txt", LEFT[:3])
    more = Dataset("clip", (*dataset, empty))
    assert nat2024.evaluate(results, more).summary().sequences.tolist() == [2, 2]


def test_nothing_to_score(results: Path, tmp_path: Path) -> None:
    other = Dataset("clip", (sequence("other", LEFT),))
    with pytest.raises(DatasetNotFound, match="no result of any sequence of clip"):
        nat2024.evaluate(results, other)
    with pytest.raises(DatasetNotFound, match=r"no results of elsewhere; it holds clip"):
        nat2024.evaluate(results, Dataset("elsewhere", ()))


def test_gains_over_the_tracker_alone(results: Path, dataset: Dataset) -> None:
    for name in ("long", "short"):  # no kcf alone: nothing to compare with
        nat2024.write_boxes(results / "clip" / "kcf+gamma" / f"{name}.txt", dataset[name].boxes)
    evaluation = nat2024.evaluate(results, dataset)
    gains = evaluation.gains()
    assert list(gains.columns) == [
        *("dataset", "run", "tracker", "enhancer", "scope", "protocol", "base", "metric"),
        *("sequences", "value", "base_value"),
        *("difference", "difference_low", "difference_high"),
        *("gain", "gain_low", "gain_high", "improved", "certain"),
    ]
    assert set(gains.run) == {"mil+gamma@soft"}
    assert set(gains.base) == {"mil"}
    success = gains.set_index("metric").loc["success_auc"]
    assert success.sequences == 2
    assert success.value == pytest.approx(20 / 21)
    assert success.base_value == pytest.approx(10 / 21)
    assert success.gain == pytest.approx(100)
    # of two sequences one is better by all: a draw has none, one or both of them
    assert (success.difference_low, success.difference_high) == pytest.approx((0, 20 / 21))
    assert success.improved == 0.5
    assert not success.certain
    again = evaluation.gains(resamples=500, seed=1)
    assert again.difference.tolist() == gains.difference.tolist()


def test_gains_compare_what_both_have(results: Path, dataset: Dataset) -> None:
    (results / "clip" / "mil+gamma@soft" / "short.txt").unlink()
    gains = nat2024.evaluate(results, dataset).gains().set_index("metric")
    assert gains.sequences.tolist() == [1, 1, 1]
    assert gains.base_value["precision_20"] == 1.0  # that of `long`, not of both
    assert gains.gain["precision_20"] == 0.0
    assert gains.gain_low.isna().all()
    (results / "clip" / "mil" / "long.txt").unlink()  # nothing in common any more
    assert nat2024.evaluate(results, dataset).gains().empty


def test_gains_by_attribute_and_category(results: Path) -> None:
    long = sequence("long", LEFT, attributes=frozenset({"IV", "FM"}), category="car")
    short = sequence("short", SHORT, attributes=frozenset({"IV"}), category="bike")
    dataset = Dataset("clip", (long, short, sequence("new", LEFT, category="dog")))
    evaluation = nat2024.evaluate(results, dataset)
    by = evaluation.gains(by="attribute").set_index(["attribute", "metric"])
    assert by.sequences.loc[:, "precision_20"].to_dict() == {"FM": 1, "IV": 2}
    assert by.difference.loc[:, "precision_20"].to_dict() == {"FM": 0.0, "IV": 0.5}
    kinds = evaluation.gains(by="category").set_index(["category", "metric"])
    assert kinds.difference.loc[:, "precision_20"].to_dict() == {"bike": 1.0, "car": 0.0}


def test_gains_are_those_of_the_summary_under_every_protocol(
    results: Path, dataset: Dataset
) -> None:
    for protocol in list_protocols():
        evaluation = nat2024.evaluate(results, dataset, protocol=protocol)
        summary = evaluation.summary().set_index("run")
        gains = evaluation.gains(resamples=50)
        assert len(gains)
        for row in gains.to_dict(orient="records"):
            assert row["value"] == pytest.approx(summary.loc[row["run"], row["metric"]])
            assert row["base_value"] == pytest.approx(summary.loc[row["base"], row["metric"]])


def test_scores_of_one_sequence_are_those_of_its_summary(results: Path, dataset: Dataset) -> None:
    for protocol in list_protocols():
        evaluation = nat2024.evaluate(results, dataset, protocol=protocol)
        rows = evaluation.per_sequence().set_index(["run", "sequence"])
        for run in evaluation.runs:
            for name, scores in run.sequences.items():
                alone = summarize([scores], protocol)
                expected = [getattr(alone, score) for score in SCORES]
                found = rows.loc[(run.run, name), list(SCORES)].tolist()
                assert found == pytest.approx(expected, nan_ok=True, abs=1e-15)


def test_per_category(results: Path) -> None:
    long, short = sequence("long", LEFT, category="car"), sequence("short", SHORT)
    table = nat2024.evaluate(results, Dataset("clip", (long, short))).per_category()
    assert list(table.columns)[6:8] == ["category", "sequences"]
    assert table.set_index("run").loc["mil", ["category", "precision_20"]].tolist() == ["car", 1.0]
    assert len(table) == 2  # nothing tells what `short` is


def test_curves_of_every_sequence(results: Path, dataset: Dataset) -> None:
    evaluation = nat2024.evaluate(results, dataset)
    curves = evaluation.sequence_curves()["mil"]
    assert curves.sequences == ("long", "short")
    assert curves.success.shape == (2, 21)
    assert curves.normalized_precision.shape == (2, 51)
    mean = evaluation.curves().query("run == 'mil' and metric == 'precision'").value
    assert curves.precision.mean(axis=0).tolist() == pytest.approx(mean.tolist())


def test_what_holds_for_many_runs_is_said_once(results: Path, dataset: Dataset) -> None:
    for run in ("kcf", "mosse", "fdsst"):
        nat2024.write_boxes(results / "clip" / run / "long.txt", LEFT)
    lines = nat2024.evaluate(results, dataset).remarks()
    assert "fdsst, kcf, mosse: no result of 1 sequence, short" in lines
    assert sum("strict" in line for line in lines) == 1
    assert lines[-1] == (
        "5 runs differ from protocol strict, most fdsst: "
        "success is 0.952 here and 1.000 under strict"
    )
