"""Results of other toolkits are scored where they lie, and what is odd about them is told."""

import json
import logging
import zipfile
from pathlib import Path

import numpy as np
import pytest

import nat2024
from nat2024.boxes import parse_boxes
from nat2024.errors import DatasetNotFound, LengthMismatch
from nat2024.types import Dataset


class Frames:
    """Black frames."""

    frame_size = (16, 12)

    def __init__(self, count: int) -> None:
        self.count = count

    def __len__(self) -> int:
        return self.count

    def __getitem__(self, index: int) -> np.ndarray:
        if index >= self.count:
            raise IndexError(index)
        return np.zeros((12, 16, 3), np.uint8)


LENGTHS = {"Human4_2": 4, "car1": 6, "person1": 5}


def truth(name: str) -> np.ndarray:
    return np.tile(np.array([10.0, 20.0, 8.0, 8.0]), (LENGTHS[name], 1))


@pytest.fixture
def dataset() -> Dataset:
    sequences = [nat2024.Sequence(n, Frames(count), truth(n)) for n, count in LENGTHS.items()]
    return Dataset("UAVDark135", tuple(sequences))


def write(folder: Path, shift: float = 0.0, offset: float = 0.5, **more: np.ndarray) -> None:
    for name in LENGTHS:
        rows = truth(name) + np.array([shift, 0, 0, 0])
        rows[0] = truth(name)[0] + np.array([offset, offset, 0, 0])
        nat2024.write_boxes(folder / f"{name}.txt", rows)
    for name, rows in more.items():
        nat2024.write_boxes(folder / f"{name}.txt", rows)


def test_names_are_mapped_and_gains_computed(tmp_path: Path, dataset: Dataset) -> None:
    write(tmp_path / "results" / "UAVDark135" / "SiamRPN++", shift=100)
    write(tmp_path / "results" / "UAVDark135" / "LDE-SiamRPN++")
    evaluation = nat2024.evaluate(tmp_path / "results", dataset)
    frame = evaluation.summary()
    assert frame[["run", "tracker", "enhancer", "scope"]].to_numpy().tolist() == [
        ["LDE-SiamRPN++", "siamrpnpp", "ldenhancer", ""],
        ["SiamRPN++", "siamrpnpp", "none", ""],
    ]
    assert frame.precision_20.tolist() == pytest.approx([1.0, (1 / 4 + 1 / 5 + 1 / 6) / 3])
    gains = evaluation.gains()
    assert set(gains.base) == {"SiamRPN++"}
    assert evaluation.notes()["first_rows"]["SiamRPN++"]["offset"] == [0.5, 0.5]
    told = "(+0.5, +0.5) px from the annotation, as the testers of pysot write them"
    assert sum(told in line for line in evaluation.remarks()) == 1


def test_repeats_are_averaged_with_their_deviation(tmp_path: Path, dataset: Dataset) -> None:
    for name in LENGTHS:
        for repeat, shift in ((1, 0.0), (2, 1000.0)):
            rows = truth(name) + np.array([shift, 0, 0, 0])
            folder = tmp_path / "UAVDark135" / "SiamFC" / name
            nat2024.write_boxes(folder / f"{name}_{repeat:03d}.txt", rows)
    evaluation = nat2024.evaluate(tmp_path, dataset)
    (row,) = evaluation.summary().to_dict(orient="records")
    assert row["precision_20"] == pytest.approx(0.5)
    assert row["success_auc"] == pytest.approx(10 / 21)
    note = evaluation.notes()["repeats"]["SiamFC"]
    assert note["count"] == 2
    assert note["deviation"]["precision_20"] == pytest.approx(np.sqrt(0.5))
    assert any(
        "mean of 2 repeats, standard deviation success 0.6734, precision 0.7071" in line
        for line in evaluation.remarks()
    )


def test_what_cannot_be_read_is_left_out_and_named(tmp_path: Path, dataset: Dataset) -> None:
    folder = tmp_path / "UAVDark135" / "HiFT"
    write(folder, **{"Human4-2": truth("Human4_2")})
    (folder / "Human4_2.txt").unlink()
    (folder / "car1.txt").write_text("")
    evaluation = nat2024.evaluate(tmp_path, dataset)
    assert list(evaluation.runs[0].sequences) == ["person1"]
    notes = evaluation.notes()
    assert "no boxes in it" in notes["unreadable_results"]["HiFT"]["car1"]
    assert notes["unknown_sequences"]["HiFT"] == {"Human4-2": "closest: Human4_2"}
    assert notes["missing_sequences"]["HiFT"] == ["Human4_2"]
    lines = "\n".join(evaluation.remarks())
    assert "no sequence of the dataset is called Human4-2 (closest: Human4_2)" in lines


def test_a_first_box_of_another_video_is_told(tmp_path: Path, dataset: Dataset) -> None:
    folder = tmp_path / "UAVDark135" / "HiFT"
    write(folder)
    nat2024.write_boxes(folder / "car1.txt", truth("car1") + np.array([50, 0, 0, 0]))
    notes = nat2024.evaluate(tmp_path, dataset).notes()
    assert notes["other_first_boxes"] == {"HiFT": ["car1"]}


def test_wrong_lengths_are_refused_or_left_out(tmp_path: Path, dataset: Dataset) -> None:
    folder = tmp_path / "UAVDark135" / "HiFT"
    write(folder)
    nat2024.write_boxes(folder / "car1.txt", truth("car1")[:5])
    with pytest.raises(LengthMismatch, match=r"car1\.txt.*5.*6"):
        nat2024.evaluate(tmp_path, dataset)
    kept = nat2024.evaluate(tmp_path, dataset, skip_faulty=True)
    assert list(kept.runs[0].sequences) == ["Human4_2", "person1"]
    assert "car1" in kept.notes()["unreadable_results"]["HiFT"]


def test_runs_with_nothing_to_score_say_why(
    tmp_path: Path, dataset: Dataset, caplog: pytest.LogCaptureFixture
) -> None:
    path = tmp_path / "UAVDark135" / "VOT" / "baseline" / "car1" / "car1_001.txt"
    path.parent.mkdir(parents=True)
    path.write_text("1\n1,2,3,4\n")
    with pytest.raises(DatasetNotFound, match=r"no result of any .* a VOT short-term result"):
        nat2024.evaluate(tmp_path, dataset)
    write(tmp_path / "UAVDark135" / "HiFT")
    with caplog.at_level(logging.WARNING, "nat2024"):
        assert len(nat2024.evaluate(tmp_path, dataset).runs) == 1
    assert "left out: VOT: " in caplog.text


def test_runs_of_other_datasets_are_left_alone(tmp_path: Path, dataset: Dataset) -> None:
    for other, shift in (("UAVDark135", 0), ("UAVDark70", 300)):
        for name in LENGTHS:
            rows = truth(name) + np.array([shift, 0, 0, 0])
            path = tmp_path / "tracking_results" / "dimp" / "dimp50" / other / f"{name}.txt"
            path.parent.mkdir(parents=True, exist_ok=True)
            lines = ["\t".join(str(int(v)) for v in row) for row in rows.tolist()]
            path.write_text("\n".join(lines) + "\n")
            path.with_name(f"{name}_time.txt").write_text("0.1\n" * len(rows))
    (row,) = nat2024.evaluate(tmp_path, dataset).summary().to_dict(orient="records")
    assert (row["run"], row["precision_20"]) == ("dimp50-UAVDark135", 1.0)
    assert row["tracker"] == "dimp50"


@pytest.mark.shared
def test_the_reference_kit_is_scored_inside_its_archive(shared: Path) -> None:
    kit = shared / "parity" / "metrics"
    archive = kit / "uavdark135_reference.zip"
    expected = json.loads((kit / "uavdark135_reference_expected.json").read_text())
    with zipfile.ZipFile(archive) as file:
        truths = {
            name: parse_boxes(file.read(f"anno/{name}.txt"))
            for name in (Path(n).stem for n in file.namelist() if n.startswith("anno/"))
            if name != "anno"
        }
    sequences = (nat2024.Sequence(n, Frames(len(b)), b) for n, b in truths.items())
    whole = Dataset("uavdark135", tuple(sequences))
    evaluation = nat2024.evaluate(archive, whole)
    rows = {row["run"]: row for row in evaluation.summary().to_dict(orient="records")}
    assert sorted(rows) == sorted(expected["trackers"])
    for name, row in rows.items():
        overall = expected["protocols"]["pysot"][name]["overall"]
        assert row["sequences"] == 135
        assert row["success_auc"] == pytest.approx(overall["success_auc"], abs=1e-12)
        assert row["precision_20"] == pytest.approx(overall["precision_at_20"], abs=1e-12)
        assert row["tracker"] == "dimp50"
    enhancers = {name: row["enhancer"] for name, row in rows.items()}
    assert enhancers == {
        "dimp50": "none",
        "dimp50_DCE": "dce",
        "dimp50_DarkLighter": "darklighter",
        "dimp50_EnlightenGAN": "enlightengan",
        "dimp50_LIME": "lime",
    }
