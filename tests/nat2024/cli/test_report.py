"""`nat-bench report`: from a folder of results to one page."""

import csv
import io
import json
import re
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from nat2024.boxes import read_boxes, write_boxes
from nat2024.store import DatasetRecord, Manifest, PluginRecord, RunFolder, StageTimes


@pytest.fixture(scope="module")
def clip(night_clip: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return Path(shutil.copytree(night_clip, tmp_path_factory.mktemp("report") / "clip"))


@pytest.fixture
def results(clip: Path, tmp_path: Path) -> Path:
    """Foreign results of two trackers, one with an enhancer: the truth, moved by some pixels."""
    folder = tmp_path / "results"
    for run, shift in (("mine", 3.0), ("mine+clahe", 1.0), ("other", 6.0)):
        for truth in sorted((clip / "anno").glob("*.txt")):
            write_boxes(folder / "clip" / run / truth.name, read_boxes(truth) + [shift, 0, 0, 0])
    return folder


def data_of(out: Path) -> Any:
    html = (out / "index.html").read_text()
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', html, re.S)
    assert found is not None
    return json.loads(found[1])


def test_one_page_with_everything(cli: Any, results: Path, clip: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    words = ("report", "--results", results, "--dataset", clip, "--out", out, "--title", "A & B")
    status, text, err = cli(*words, "--json")
    assert status == 0, err
    path = out / "index.html"
    assert json.loads(text) == {
        "written": [{"path": str(path), "bytes": path.stat().st_size}],
        "datasets": [{"name": "clip", "runs": 3, "sequences": 3}],
    }
    data = data_of(out)
    assert data["title"] == "A & B"
    (dataset,) = data["datasets"]
    assert [run["name"] for run in dataset["runs"]] == ["mine", "mine+clahe", "other"]
    assert [run["base"] for run in dataset["runs"]] == [None, 0, None]
    assert [one["title"] for one in dataset["protocols"]][:2] == ["pysot", "otb"]
    assert len(dataset["protocols"]) == 8
    status, text, _ = cli("eval", "--results", results, "--dataset", clip, "--json")
    wanted = {row["run"]: row["success_auc"] for row in json.loads(text)["summary"]}
    rows = dataset["protocols"][0]["subsets"][0]["rows"]
    shown = {
        run["name"]: row["success_auc"] for run, row in zip(dataset["runs"], rows, strict=True)
    }
    assert shown == pytest.approx(wanted, abs=1e-6)
    assert any("no manifest" in line for line in dataset["remarks"])
    html = path.read_text()
    assert html.count("data:image/jpeg;base64,") >= 3
    assert dataset["light"][0]["key"] == "unevenness"


def test_frames_have_the_numbers_that_tables_give_them(cli: Any, tmp_path: Path) -> None:
    long, size = tmp_path / "long", ("--sequences", "1", "--size", "160x96")
    assert cli("dataset", "synthesize", long, "--frames", "16", *size)[0] == 0
    (truth,) = (long / "anno").glob("*.txt")
    boxes = read_boxes(truth)
    boxes[5:, 0] += 10_000
    write_boxes(tmp_path / "results" / "long" / "mine" / truth.name, boxes)
    words = ("--results", tmp_path / "results", "--dataset", long)
    assert cli("report", *words, "--out", tmp_path / "out")[0] == 0
    (row,) = data_of(tmp_path / "out")["datasets"][0]["failures"]["rows"]
    _, text, _ = cli("table", *words, "--layout", "losses", "--format", "csv")
    table = list(csv.DictReader(io.StringIO(text)))
    assert [row["first_loss"], *(float(one["first_loss"]) for one in table)] == [5, 5]
    assert 0 < row["luminance_at_loss"] < 1


def test_the_same_bytes_again(cli: Any, results: Path, clip: Path, tmp_path: Path) -> None:
    pages = []
    for name in ("first", "second"):
        words = ("report", "--results", results, "--dataset", clip, "--out", tmp_path / name)
        status, text, err = cli(*words)
        assert status == 0, err
        assert text.startswith(f"{tmp_path / name}/index.html: ")
        pages.append((tmp_path / name / "index.html").read_bytes())
    assert pages[0] == pages[1]


def test_no_frames(cli: Any, results: Path, clip: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    words = ("report", "--results", results, "--dataset", clip, "--out", out, "--no-frames")
    assert cli(*words)[0] == 0
    (dataset,) = data_of(out)["datasets"]
    assert dataset["light"] == []
    assert "frames were left out: no light and no pictures" in dataset["remarks"]
    assert "data:image" not in (out / "index.html").read_text()


def test_poor_results_make_a_page_that_says_so(
    cli: Any, results: Path, clip: Path, tmp_path: Path
) -> None:
    folder = results / "clip"
    for run in ("mine+clahe", "other"):
        shutil.rmtree(folder / run)
    (folder / "mine" / "tall.txt").unlink()
    boxes = read_boxes(folder / "mine" / "wide.txt")
    write_boxes(folder / "mine" / "wide.txt", np.full_like(boxes, np.nan))
    bare = Path(shutil.copytree(clip, tmp_path / "bare" / "clip"))
    for frame in bare.rglob("*.png"):
        frame.write_bytes(b"no image")
    out = tmp_path / "out"
    status, _, err = cli("report", "--results", results, "--dataset", bare, "--out", out)
    assert status == 0, err
    (dataset,) = data_of(out)["datasets"]
    remarks = "\n".join(dataset["remarks"])
    for words in ("one run only", "tall", "bad result rows", "images"):
        assert words in remarks
    assert [one["name"] for one in dataset["sequences"]] == ["narrow", "wide"]


def test_several_datasets_are_one_page(cli: Any, results: Path, clip: Path, tmp_path: Path) -> None:
    timing = StageTimes(8, 0.0, 0.0, 0.02, 0.1, 50.0, 50.0)
    for name in ("clip", "again"):
        data = Path(shutil.copytree(clip, tmp_path / "data" / name))
        folder = Path(shutil.copytree(results / "clip" / "mine", tmp_path / "own" / name / "mine"))
        record = DatasetRecord(name, source=str(data))
        manifest = Manifest(dataset=record, tracker=PluginRecord("mine"), timing=timing)
        RunFolder(folder).write_manifest(manifest)
    own = tmp_path / "own"
    out = tmp_path / "out"
    status, _, err = cli("report", "--results", own, "--out", out, "--no-frames")
    assert status == 0, err
    data = data_of(out)
    assert [one["name"] for one in data["datasets"]] == ["again", "clip"]
    assert data["title"] == "Night tracking on again, clip"
    assert data["datasets"][0]["runs"][0]["speed"] == 50.0


def test_what_cannot_be_done_is_one_line(cli: Any, results: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    empty = tmp_path / "empty"
    empty.mkdir()
    status, _, err = cli("report", "--results", empty, "--out", out)
    assert (status, "holds no results" in err) == (2, True)
    status, _, err = cli("report", "--results", results, "--out", out)
    assert (status, "name it with --dataset" in err) == (2, True)
    assert not out.exists()
    file = tmp_path / "file"
    file.write_text("")
    status, _, err = cli("report", "--results", results, "--out", file / "inside")
    assert (status, "cannot be written" in err) == (2, True)
