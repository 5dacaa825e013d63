"""The paper's tables come out of files that were made to hold just these scores.

A frame is a hit (the true box: overlap 1, so 20 of the 21 thresholds, and no error), near (15 px
beside a box of 10 px: overlap 0, within 20 px) or lost. With 1000 frames in two sequences of equal
length success is hits / 1000 * 20 / 21 and precision is (hits + near) / 1000.
"""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

import nat2024
from nat2024.cli import run
from nat2024.datasets import registered
from nat2024.datasets.registered import DatasetFacts, SequenceFacts
from nat2024.errors import DatasetNotFound, UsageError
from nat2024.reproducing import PUBLICATIONS, ComparedRow, reproduce

LENGTH = 500
NAMES = ("bike1", "car2")
START = {"bike1": (10.0, 20.0, 10.0, 10.0), "car2": (30.0, 40.0, 10.0, 10.0)}

# hits and near frames of 1000 that print as the paper's success and precision
PAPER = {
    "others/SiamRPN++": (391, 83),
    "others/RUAS-SiamRPN++": (400, 90),
    "others/LIME-SiamRPN++": (413, 88),
    "others/EnlightenGAN-SiamRPN++": (417, 88),
    "others/LLVE-SiamRPN++": (417, 91),
    "others/DCE++-SiamRPN++": (422, 90),
    "others/DarkLighter-SiamRPN++": (404, 91),
    "UAVDark135/LDE-SiamRPN++": (456, 104),
}
SCT = (442, 105)


def truth(name: str, length: int = LENGTH) -> np.ndarray:
    rows = np.tile(np.array(START[name]), (length, 1))
    rows[:, 0] += np.arange(length)
    return rows


def write_run(folder: Path, hits: int, near: int, lengths: dict[str, int] | None = None) -> None:
    """The first frames are hits, so that first rows are the annotated boxes."""
    for number, name in enumerate(NAMES):
        rows = truth(name, (lengths or {}).get(name, LENGTH))
        good, close = (hits + number) // 2, (near + number) // 2
        rows[good : good + close, 0] += 15
        rows[good + close :, 0] += 1000
        nat2024.write_boxes(folder / f"{name}.txt", rows)


def write_copy(folder: Path, lengths: dict[str, int], moved: str = "") -> Path:
    image = cv2.imencode(".jpg", np.zeros((8, 8, 3), np.uint8))[1].tobytes()
    for name, length in lengths.items():
        frames = folder / "data_seq" / name
        frames.mkdir(parents=True)
        for number in range(1, length + 1):
            (frames / f"{number:05d}.jpg").write_bytes(image)
        rows = truth(name, length)
        if name == moved:
            rows[0] += np.array([3.0, 0, 0, 0])
        nat2024.write_boxes(folder / "anno" / f"{name}.txt", rows)
    return folder


@pytest.fixture(autouse=True)
def small_uavdark135(monkeypatch: pytest.MonkeyPatch) -> None:
    """UAVDark135 as if two sequences of 500 frames were all of it."""
    facts = DatasetFacts(
        title="UAVDark135",
        folders=("UAVDark135",),
        sequences={name: SequenceFacts(LENGTH, START[name]) for name in NAMES},
    )
    monkeypatch.setitem(registered._registered, "uavdark135", facts)


@pytest.fixture(scope="module")
def copy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("data") / "UAVDark135"
    return write_copy(folder, dict.fromkeys(NAMES, LENGTH))


@pytest.fixture(scope="module")
def published(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder `results` as the authors publish it."""
    results = tmp_path_factory.mktemp("LDEnhancer") / "results"
    for name, (hits, near) in PAPER.items():
        write_run(results / name, hits, near)
    write_run(results / "UAVDark135" / "LDE-HiFT", 300, 100)
    write_run(results / "NAT2024-2" / "LDE-SiamRPN++", 1, 1)
    return results


@pytest.fixture(scope="module")
def sct(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same of SCT, with a run that the first folder has too."""
    results = tmp_path_factory.mktemp("SCT") / "results"
    write_run(results / "AgainstOtherEn" / "siamrpn_alex_dwxcorr_SCT", *SCT)
    write_run(results / "AgainstOtherEn" / "siamrpn_alex_dwxcorr_LIME", 2, 0)
    write_run(results / "Overall" / "DarkTrack2021" / "HiFT_SCT", 1, 1)
    write_run(results / "Overall" / "UAVDark135" / "HiFT_SCT", 1, 1)
    return results


def by_method(rows: tuple[ComparedRow, ...], table: str) -> dict[str, ComparedRow]:
    return {row.method: row for row in rows if row.table.startswith(table)}


def test_gains_of_the_paper_are_those_of_its_scores() -> None:
    for publication in PUBLICATIONS.values():
        base = publication.tables[0].rows[0]
        for table in publication.tables:
            for row in table.rows[table.rows[0] is base :]:
                success = 100 * (row.success - base.success) / base.success
                precision = 100 * (row.precision - base.precision) / base.precision
                assert (round(success, 3), round(precision, 3)) == (
                    row.success_gain,
                    row.precision_gain,
                )


def test_every_number_of_table_iv_comes_out(copy: Path, published: Path, sct: Path) -> None:
    found = reproduce("ldenhancer", [published, sct], copy)
    assert found.ok
    assert found.protocol == "pysot"
    rows = by_method(found.rows, "Table IV")
    assert len(rows) == 11
    assert [name for name, row in rows.items() if row.equal is None] == ["KinD++", "HighlightNet"]
    for name, row in rows.items():
        if row.equal is None:
            assert row.note == "no result files are published"
            assert set(row.files.values()) == {None}
            continue
        assert row.equal, name
        assert set(row.difference.values()) <= {0.0, None}
        assert row.sequences == 2
    assert rows["LDEnhancer"].files["success"] == pytest.approx(456 / 1000 * 20 / 21, abs=1e-12)
    assert rows["LDEnhancer"].files["precision"] == pytest.approx(0.560, abs=1e-12)
    assert rows["LDEnhancer"].files["success_gain"] == pytest.approx(16.667, abs=5e-4)
    assert rows["SiamRPN++"].files["success_gain"] is None
    assert rows["SCT"].run == "siamrpn_alex_dwxcorr_SCT"
    assert any("siamrpn_alex_dwxcorr_LIME: not taken" in line for line in found.remarks)


def test_table_v_where_files_are(copy: Path, published: Path) -> None:
    rows = by_method(reproduce("ldenhancer", [published], copy).rows, "Table V")
    assert [row.equal for row in rows.values()] == [None, None, None, True]
    assert rows["Baseline"].note == "no result files of this variant are published"
    assert (
        rows["Baseline+TB+LS+TF"].files
        == by_method(reproduce("ldenhancer", [published], copy).rows, "Table IV")[
            "LDEnhancer"
        ].files
    )


def test_missing_folders_are_said(copy: Path, published: Path) -> None:
    alone = reproduce("ldenhancer", [published / "UAVDark135"], copy)
    rows = by_method(alone.rows, "Table IV")
    assert rows["LDEnhancer"].note == "no gain without results of the tracker alone"
    assert rows["LDEnhancer"].files["success_gain"] is None
    assert "not among the results: results/AgainstOtherEn" in rows["SCT"].note
    assert rows["LDEnhancer"].equal


def test_other_scores_differ_by_what_they_differ(
    copy: Path, published: Path, tmp_path: Path
) -> None:
    write_run(tmp_path / "mine" / "SiamRPN++", *PAPER["others/SiamRPN++"])
    write_run(tmp_path / "mine" / "LIME-SiamRPN++", 413 + 21, 88)
    row = by_method(reproduce("ldenhancer", [tmp_path / "mine"], copy).rows, "Table IV")["LIME"]
    assert row.equal is False
    # 434 hits print as 0.413, 522 of 1000 frames within 20 px as 0.522
    assert row.difference["success"] == 0.020
    assert row.difference["precision"] == 0.021
    gain = 100 * (0.413 - 0.372) / 0.372
    assert row.difference["success_gain"] == pytest.approx(gain - 5.645, abs=6e-4)


def test_a_wrong_copy_is_told(
    published: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    wrong = write_copy(tmp_path / "UAVDark135", {"bike1": 499, "car2": LENGTH}, moved="car2")
    found = reproduce("ldenhancer", [published], wrong)
    assert not found.ok
    assert found.copy_problems == (
        "bike1: 499 frames, published 500",
        "car2: first box 33,40,10,10, published 30,40,10,10",
    )
    row = by_method(found.rows, "Table IV")["LDEnhancer"]
    assert (row.sequences, row.note) == (1, "over 1 of 2 sequences")
    assert any("500" in line and "499" in line for line in found.remarks)
    command = ["reproduce", "ldenhancer", "--root", str(wrong), "--results", str(published)]
    assert run(command) == 1
    told = capsys.readouterr().err
    assert "this copy of uavdark135 is not as published" in told
    assert "bike1: 499 frames, published 500" in told


def test_the_verb(copy: Path, published: Path, capsys: pytest.CaptureFixture[str]) -> None:
    command = ["reproduce", "ldenhancer", "--root", str(copy), "--results", str(published)]
    assert run([*command, "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["copy_problems"] == []
    assert len(document["rows"]) == 15
    assert document["rows"][0]["paper"]["success"] == 0.372
    assert document["rows"][0]["paper"]["success_gain"] is None
    assert run([*command, "--format", "markdown"]) == 0
    text = capsys.readouterr().out
    row = next(line for line in text.splitlines() if line.startswith("| LDEnhancer"))
    cells = [cell.strip().strip("*") for cell in row.strip("|").split("|")]
    assert cells == ["LDEnhancer", "0.434", "0.434", "0.000", "16.667", "16.667", "0.000", "2"]
    assert run(command) == 0
    assert "8 of 8 rows with files are equal in every digit printed" in capsys.readouterr().out
    assert run([*command, "--json", "--format", "markdown"]) == 2


def test_an_archive_of_the_results(copy: Path, published: Path, tmp_path: Path) -> None:
    import shutil

    archive = shutil.make_archive(str(tmp_path / "LDEnhancer-main"), "zip", published.parent)
    found = reproduce("ldenhancer", [archive], copy)
    plain = reproduce("ldenhancer", [published], copy)
    assert [row.files for row in found.rows] == [row.files for row in plain.rows]


def test_wrong_use(copy: Path, published: Path, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="nothing to reproduce of 'ldenhancr'; closest: ldenh"):
        reproduce("ldenhancr", [published], copy)
    with pytest.raises(UsageError, match="no results; name the folders of https"):
        reproduce("ldenhancer", [], copy)
    with pytest.raises(DatasetNotFound, match="no such results folder"):
        reproduce("ldenhancer", [published / "absent"], copy)
    other = tmp_path / "results"
    write_run(other / "DarkTrack2021" / "HiFT", 1, 1)
    with pytest.raises(DatasetNotFound, match="no results of uavdark135; it holds DarkTrack2021"):
        reproduce("ldenhancer", [other], copy)
