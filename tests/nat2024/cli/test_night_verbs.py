"""`nat-bench dataset synthesize` and `darken` as a user meets them."""

import json
from pathlib import Path
from typing import Any

import pytest

SMALL = ("--sequences", 1, "--frames", 3, "--size", "160x96")


def test_synthesize_tells_what_it_made(tmp_path: Path, cli: Any) -> None:
    folder = tmp_path / "n"
    status, out, _ = cli(
        "dataset", "synthesize", folder, *SMALL, "--target", "person", "--png", "--json"
    )
    assert status == 0
    found = json.loads(out)
    assert found["frame_size"] == "160x96"
    (sequence,) = found["sequences"]
    assert (sequence["name"], sequence["frames"], sequence["target"]) == ("person1", 3, "person")
    names = sorted(path.name for path in (folder / "data_seq" / "person1").iterdir())
    assert names == ["00001.png", "00002.png", "00003.png", "cover.label"]


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--size", "big"], "expected WIDTHxHEIGHT"),
        (["--size", "20x20"], "frame size"),
        (["--mean", "2"], "mean grey level"),
        (["--photographs", "absent"], "no photographs in it"),
    ],
)
def test_synthesize_refuses_with_one_line(
    tmp_path: Path, cli: Any, words: list[str], told: str
) -> None:
    status, out, err = cli("dataset", "synthesize", tmp_path / "n", *words)
    assert status == 2
    assert out == ""
    assert told in err
    assert len(err.splitlines()) == 1
    assert not (tmp_path / "n").exists()


def test_darken_writes_a_dataset_for_each_level(night_clip: Path, tmp_path: Path, cli: Any) -> None:
    words = ("dataset", "darken", night_clip, "--out", tmp_path, "--sequences", "tall")
    status, out, _ = cli(*words, "--levels", "0.1,0.05", "--json")
    assert status == 0
    found = json.loads(out)
    assert found["levels"] == [0.1, 0.05]
    assert found["folders"] == [str(tmp_path / "night_clip-0.1"), str(tmp_path / "night_clip-0.05")]
    assert found["sequences"] == [{"name": "tall", "frames": 8, "fault": ""}]
    truth = (night_clip / "anno" / "tall.txt").read_bytes()
    assert (tmp_path / "night_clip-0.1" / "anno" / "tall.txt").read_bytes() == truth
    status, _, err = cli(*words, "--levels", "0.1")
    assert status == 2
    assert "is not empty" in err


@pytest.mark.parametrize("levels", ["dark", "0.9", ""])
def test_darken_refuses_other_levels(
    night_clip: Path, tmp_path: Path, cli: Any, levels: str
) -> None:
    status, _, err = cli(
        "dataset", "darken", night_clip, "--out", tmp_path / "o", "--levels", levels
    )
    assert status == 2
    assert "level" in err
    assert len(err.splitlines()) == 1


def test_darken_tells_a_frame_that_fails(night_clip: Path, tmp_path: Path, cli: Any) -> None:
    import shutil

    copy = tmp_path / "copy"
    shutil.copytree(night_clip, copy)
    (copy / "data_seq" / "tall" / "00003.png").write_bytes(b"no image")
    status, out, err = cli("dataset", "darken", copy, "--out", tmp_path / "o", "--levels", "0.1")
    assert status == 1
    assert "1 sequences left out: tall" in out
    assert "00003.png" in err
