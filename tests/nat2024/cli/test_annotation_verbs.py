"""`nat-bench dataset index | convert | schema`, and `validate` with an index."""

import json
import shutil
from pathlib import Path
from typing import Any

import pytest


@pytest.fixture
def clip(night_clip: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(night_clip, tmp_path / "clip"))


def test_index_and_validate(clip: Path, cli: Any) -> None:
    status, out, _ = cli("dataset", "index", clip)
    assert (status, out) == (0, f"{clip}/nat-bench.json: 3 sequences, 24 frames, 24 checksums\n")
    status, out, _ = cli("dataset", "validate", clip)
    assert status == 0
    assert "checked against: index nat-bench.json (nat-bench/1)\n" in out
    frame = clip / "data_seq" / "tall" / "00003.png"
    frame.write_bytes((clip / "data_seq" / "tall" / "00004.png").read_bytes())
    status, out, _ = cli("dataset", "validate", clip)
    assert status == 1
    assert "problem: tall: 00003.png altered, by size or checksum\n" in out
    status, _, err = cli("dataset", "index", clip)
    assert status == 2
    assert err == f"nat-bench: {clip}/nat-bench.json is there already; --force writes it anew\n"
    status, out, _ = cli("dataset", "index", clip, "--force", "--no-checksums", "--json")
    assert json.loads(out) == {
        "out": f"{clip}/nat-bench.json",
        "schema": "nat-bench/1",
        "name": "clip",
        "sequences": 3,
        "frames": 24,
        "checksums": 0,
    }


def test_computed_attributes_reach_the_scores(
    clip: Path, cli: Any, tmp_path: Path, small_plugins: str
) -> None:
    labels = tmp_path / "labels.csv"
    assert cli("dataset", "attributes", clip, "--out", labels)[0] == 0
    header, *rows = labels.read_text().splitlines()
    columns = header.split(",")
    manual = ["tall", "manual"] + ["1" if c == "UL" else "" for c in columns[2:]]
    labels.write_text("\n".join([header, *rows, ",".join(manual)]) + "\n")
    assert cli("dataset", "index", clip, "--attributes", labels)[0] == 0
    results = tmp_path / "results"
    words = ("run", "--tracker", "still", "--dataset", clip, "--results", results, "--quiet")
    assert cli(*words)[0] == 0
    status, out, _ = cli("eval", "--results", results, "--dataset", clip, "--json")
    assert status == 0
    found = {row["attribute"]: row["provenance"] for row in json.loads(out)["per_attribute"]}
    assert found["UL"] in ("manual", "mixed")
    assert {p for a, p in found.items() if a != "UL"} <= {"computed"}


def test_an_index_elsewhere(clip: Path, cli: Any, tmp_path: Path) -> None:
    path = tmp_path / "mine.json"
    assert cli("dataset", "index", clip, "--out", path)[0] == 0
    assert not (clip / "nat-bench.json").exists()
    status, out, _ = cli("dataset", "validate", path, "--root", clip)
    assert (status, "ok\n" in out) == (0, True)
    status, _, err = cli("dataset", "info", path / "x")
    assert (status, err.count("\n")) == (2, 1)


@pytest.mark.parametrize("name", ["got10k", "pysot", "coco-video", "published", "index"])
def test_convert(clip: Path, cli: Any, tmp_path: Path, name: str) -> None:
    status, out, _ = cli("dataset", "convert", clip, tmp_path / "out", "--to", name, "--json")
    done = json.loads(out)
    assert (status, done["format"], done["sequences"], done["copied"]) == (0, name, 3, 24)
    assert cli("dataset", "validate", tmp_path / "out")[0] == 0
    status, out, _ = cli("dataset", "info", tmp_path / "out", "--json")
    assert json.loads(out)["frames"] == 24


def test_mistakes_are_one_line(clip: Path, cli: Any, tmp_path: Path) -> None:
    for words, expected in (
        (
            ("convert", clip, tmp_path / "o", "--to", "coco"),
            "no format 'coco'; closest: coco-video",
        ),
        (("convert", clip, clip, "--to", "index"), "is not an empty folder"),
        (("convert", clip, tmp_path / "o", "--to", "index", "--from", "pysot"), "no dataset of"),
        (("convert", tmp_path / "no", tmp_path / "o", "--to", "index"), "no such folder"),
        (("index", clip, "--attributes", tmp_path / "no.csv"), "cannot be read"),
    ):
        status, out, err = cli("dataset", *words)
        assert (status, out) == (2, "")
        assert expected in err
        assert err.count("\n") == 1


def test_schema(cli: Any) -> None:
    status, out, _ = cli("dataset", "schema")
    assert status == 0
    assert json.loads(out)["title"].endswith("nat-bench/1")
    assert cli("dataset", "schema", "--json")[1] == out
