"""`nat-bench plot --kind unevenness --kind losses` and the tables of failures."""

import json
import shutil
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

import nat2024
from nat2024.boxes import write_boxes


@pytest.fixture
def results(night_clip: Path, tmp_path: Path) -> Path:
    """`mosse` and `mosse+gamma` on `night_clip`; the second jumps away in its first frames."""
    folder = tmp_path / "results"
    for name, away in (("mosse", 0.0), ("mosse+gamma", 400.0)):
        for number, sequence in enumerate(nat2024.load_dataset(str(night_clip))):
            boxes = sequence.boxes.copy()
            boxes[number:, 0] += away
            write_boxes(folder / "night_clip" / name / f"{sequence.name}.txt", boxes)
    return folder


def test_both_kinds_are_drawn_with_their_numbers(
    cli: Any, results: Path, night_clip: Path, tmp_path: Path
) -> None:
    words = ("plot", "--results", results, "--dataset", night_clip, "--out", tmp_path / "out")
    kinds = ("--kind", "unevenness", "--kind", "losses", "--sequence", "wide")
    status, out, err = cli(*words, *kinds, "--format", "png", "--json")
    assert status == 0, err
    found = json.loads(out)
    names = {one["figure"] for one in found["files"]}
    assert names == {"night_clip_unevenness_gamma", "night_clip_losses_wide"}
    assert "3 sequences, too few for an interval" in err
    gains = pd.read_csv(tmp_path / "out" / "night_clip_unevenness_gamma.csv")
    assert gains.sequence.tolist() == ["narrow", "tall", "wide"]
    assert (gains.gain < -0.5).all()
    assert gains.unevenness.notna().all()
    assert (results / "night_clip" / ".evidence" / "wide.msgpack").is_file()


def test_without_frames_it_is_said(
    cli: Any, results: Path, night_clip: Path, tmp_path: Path
) -> None:
    data = tmp_path / "night_clip"
    shutil.copytree(night_clip, data)
    for image in (data / "data_seq").glob("*/*"):
        image.write_bytes(b"no image")
    words = ("plot", "--results", results, "--dataset", data, "--out", tmp_path / "out")
    status, out, err = cli(*words, "--kind", "unevenness", "--kind", "losses", "--json")
    assert status == 0, err
    assert "no gain against light, no readable images of any sequence" in err
    assert {one["kind"] for one in json.loads(out)["files"]} == {"losses"}
    captions = {one["caption"].partition(" over ")[0] for one in json.loads(out)["files"]}
    assert captions == {"Overlap of each run"}  # and not the light that is not known


def test_tables_of_failures(cli: Any, results: Path, night_clip: Path) -> None:
    words = ("table", "--results", results, "--dataset", night_clip, "--format", "csv")
    status, out, _ = cli(*words, "--layout", "failures")
    assert status == 0
    header, plain, enhanced = out.splitlines()
    assert header.startswith("Dataset,Tracker,Enhancer,sequences,sequences_lost,first_loss")
    assert plain.startswith("night_clip,mosse,-,3.0,0.0,,0.0")
    # at most 8 frames without overlap are fewer than the 10 that make a loss
    assert enhanced.startswith("night_clip,mosse,gamma,3.0,0.0,,0.0")
    status, out, _ = cli(*words, "--layout", "losses")
    assert status == 0
    assert len(out.splitlines()) == 1
