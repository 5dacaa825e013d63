"""Results of other toolkits through the command line, and ours in their layouts."""

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import nat2024
from nat2024.datasets import registered, write_sequence
from nat2024.datasets.registered import DatasetFacts

LENGTHS = {"Human4_2": 4, "car1": 6}


def truth(length: int) -> np.ndarray:
    return np.tile(np.array([10.0, 20.0, 8.0, 8.0]), (length, 1))


@pytest.fixture
def dataset(tmp_path: Path) -> Path:
    for name, length in LENGTHS.items():
        frames = [(np.zeros((40, 40, 3), np.uint8), box) for box in truth(length)]
        write_sequence(tmp_path / "clip", name, frames)
    return tmp_path / "clip"


@pytest.fixture
def foreign(tmp_path: Path) -> Path:
    """Two runs as a repository would publish them."""
    results = tmp_path / "release" / "results" / "clip"
    for run, shift in (("SiamRPN++", 100), ("LDE-SiamRPN++", 0)):
        for name, length in LENGTHS.items():
            rows = truth(length) + np.array([shift, 0, 0, 0])
            rows[0] = truth(1)[0] + np.array([0.5, 0.5, 0, 0])
            nat2024.write_boxes(results / run / f"{name}.txt", rows)
    return tmp_path / "release"


@pytest.mark.parametrize("form", ["folder", "archive"])
def test_eval_and_table_take_foreign_results(
    cli: Any, dataset: Path, foreign: Path, tmp_path: Path, form: str
) -> None:
    results = foreign
    if form == "archive":
        results = Path(shutil.make_archive(str(tmp_path / "packed"), "zip", foreign))
    status, out, _ = cli("eval", "--results", results, "--dataset", dataset, "--json")
    assert status == 0
    document = json.loads(out)
    rows = [(row["tracker"], row["enhancer"], row["precision_20"]) for row in document["summary"]]
    assert rows == [("siamrpnpp", "ldenhancer", 1.0), ("siamrpnpp", "none", pytest.approx(5 / 24))]
    assert document["notes"]["clip"]["first_rows"]["SiamRPN++"]["offset"] == [0.5, 0.5]
    status, out, err = cli("table", "--results", results, "--dataset", dataset)
    assert status == 0
    assert "ldenhancer" in out
    assert err.count("(+0.5, +0.5)") == 1


def test_without_a_dataset_it_is_asked_for(cli: Any, foreign: Path) -> None:
    status, _, err = cli("eval", "--results", foreign / "results")
    assert status == 2
    assert "no manifest tells which dataset this is; name it with --dataset" in err


def test_the_name_of_the_folder_may_tell_the_dataset(
    cli: Any, dataset: Path, foreign: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (foreign / "results" / "clip").rename(foreign / "results" / "NAT2021L")
    facts = DatasetFacts(title="NAT2021-L", folders=("NAT2021L",))
    monkeypatch.setitem(registered._registered, "nat2021_l_test", facts)
    monkeypatch.setenv("NAT2024_ROOT_NAT2021_L_TEST", str(dataset))
    status, out, err = cli("eval", "--results", foreign / "results", "--json")
    assert status == 0
    assert {row["dataset"] for row in json.loads(out)["summary"]} == {"nat2021_l_test"}
    assert "taken for results of nat2021_l_test, as the folder is called" in err
    monkeypatch.delenv("NAT2024_ROOT_NAT2021_L_TEST")
    status, _, err = cli("eval", "--results", foreign / "results")
    assert status == 2
    assert "NAT2024_ROOT_NAT2021_L_TEST is not set" in err


def test_foreign_results_become_ours(
    cli: Any, dataset: Path, foreign: Path, tmp_path: Path
) -> None:
    own = tmp_path / "own"
    status, out, err = cli(
        *("export", "--results", foreign, "--dataset", dataset, "--format", "nat-bench"),
        *("--out", own),
    )
    assert (status, (own / "clip" / "siamrpnpp+ldenhancer" / "run.json").is_file()) == (0, True)
    assert "siamrpnpp" in out
    assert "(+0.5, +0.5)" in err
    # the manifest tells the dataset, so that nobody has to
    status, out, _ = cli("eval", "--results", own, "--json")
    assert [row["run"] for row in json.loads(out)["summary"]] == [
        "siamrpnpp",
        "siamrpnpp+ldenhancer",
    ]


def test_what_does_not_fit_is_named_and_the_rest_is_written(
    cli: Any, dataset: Path, foreign: Path, tmp_path: Path
) -> None:
    run = foreign / "results" / "clip" / "SiamRPN++"
    (run / "Human4_2.txt").rename(run / "Human4-2.txt")
    nat2024.write_boxes(run / "car1.txt", truth(5))
    command = ("export", "--results", foreign, "--dataset", dataset, "--format", "pysot")
    status, out, err = cli(*command, "--out", tmp_path / "out", "--json")
    assert status == 1
    assert "left out: SiamRPN++: clip has no sequence Human4-2; closest: Human4_2" in err
    assert "left out: SiamRPN++: car1: 5 rows, but the sequence has 6 frames; the tracker" in err
    (report,) = json.loads(out)["exported"]
    kept, emptied = report["runs"]
    assert (kept["sequences"], kept["left_out"]) == (2, {})
    assert (emptied["sequences"], emptied["path"]) == (0, "")
    assert (tmp_path / "out" / "clip" / "LDE-SiamRPN++" / "car1.txt").is_file()


def test_all_datasets_where_none_is_named(cli: Any, foreign: Path, tmp_path: Path) -> None:
    folder = foreign / "results"
    shutil.copytree(folder / "clip", folder / "other")
    command = ("export", "--format", "got10k", "--results", folder)
    status, out, _ = cli(*command, "--out", tmp_path / "out", "--json")
    assert status == 0
    assert [report["dataset"] for report in json.loads(out)["exported"]] == ["clip", "other"]
    shutil.copytree(folder, folder / "again")
    status, _, err = cli(*command, "--out", tmp_path / "more")
    assert status == 2
    assert "folders of one name" in err
    assert not (tmp_path / "more").exists()


def test_vot_must_be_told(cli: Any, tmp_path: Path) -> None:
    path = tmp_path / "VOT" / "T" / "baseline" / "a" / "a_001.txt"
    path.parent.mkdir(parents=True)
    path.write_text("1\n1,2,3,4\n2\n")
    command = ("export", "--results", tmp_path / "VOT", "--format", "pysot")
    status, _, err = cli(*command, "--out", tmp_path / "out")
    assert status == 1
    assert "started anew after each failure, is no one-pass result" in err
    status, _, err = cli(*command, "--out", tmp_path / "told", "--accept-restarts")
    assert status == 0
    assert "started anew after failures: 2 rows hold no box and are NaN" in err
    boxes = nat2024.read_boxes(tmp_path / "told" / "VOT" / "T" / "a.txt")
    assert np.isnan(boxes[[0, 2]]).all()


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--results", "absent", "--format", "pysot"], "no such results folder"),
        (["--results", ".", "--format", "pysot"], "holds no results"),
        (["--results", ".", "--format", "pysto"], "'pysto' is not one of"),
    ],
)
def test_wrong_use(
    cli: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: list[str], told: str
) -> None:
    monkeypatch.chdir(tmp_path)
    status, _, err = cli("export", *words, "--out", "out")
    assert status == 2
    assert told in err
    assert len(err.strip().splitlines()) == 1


@pytest.mark.parametrize(
    ("words", "files"),
    [
        (("--tracker", "siamrpnpp"), ["siamrpnpp-embed.onnx", "siamrpnpp-match.onnx"]),
        (("--enhancer", "ldenhancer"), ["ldenhancer-adjust.onnx", "ldenhancer-encode.onnx"]),
        (("--enhancer", "dcepp", "--size", "96x64"), ["dcepp-network.onnx"]),
    ],
)
def test_networks(cli: Any, tmp_path: Path, words: tuple[str, ...], files: list[str]) -> None:
    pytest.importorskip("onnxruntime")
    status, out, _ = cli("export", *words, "--format", "onnx", "--out", tmp_path / "net", "--json")
    assert status == 0
    assert sorted(path.name for path in (tmp_path / "net").iterdir()) == files
    parts = json.loads(out)["parts"]
    assert [Path(part["path"]).name for part in parts] != []
    for part in parts:
        assert part["dynamic"] is ("--enhancer" in words)
        assert part["difference"] < 1e-5


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("--format", "onnx"), "needs --tracker NAME or --enhancer NAME"),
        (("--format", "onnx", "--tracker", "kcf"), "kcf has no network"),
        (("--format", "pysot", "--tracker", "siamrpnpp"), "are for --format onnx"),
        (("--format", "onnx", "--tracker", "siamrpnpp", "--size", "9x9"), "is for enhancers"),
        (("--format", "onnx", "--enhancer", "dcepp", "--size", "big"), "expected WxH"),
        (("--format", "onnx", "--enhancer", "dcepp", "--opt", "sct.x=1"), "which is not run"),
    ],
)
def test_networks_asked_for_wrongly(
    cli: Any, tmp_path: Path, words: tuple[str, ...], told: str
) -> None:
    status, _, err = cli("export", *words, "--out", tmp_path / "net")
    assert status == 2
    assert told in err
    assert not (tmp_path / "net").exists()


def test_choices_are_what_the_library_knows() -> None:
    from nat2024.cli.verbs.export import RESULT_FORMATS
    from nat2024.cli.verbs.reproduce import PAPERS
    from nat2024.exporting import FORMATS
    from nat2024.reproducing import PUBLICATIONS

    assert tuple(FORMATS) == RESULT_FORMATS
    assert tuple(PUBLICATIONS) == PAPERS
