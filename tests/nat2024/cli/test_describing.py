"""`nat-bench dataset attributes` and `stats`, as a user meets them."""

import csv
import json
import shutil
from pathlib import Path
from typing import Any

import pytest


def test_attributes_as_a_table(night_clip: Path, cli: Any) -> None:
    status, out, _ = cli("dataset", "attributes", night_clip)
    assert status == 0
    assert max(map(len, out.splitlines())) <= 100
    assert "area<400, computed: the first box has fewer than 400 pixels" in out


def test_attributes_as_json(night_clip: Path, cli: Any) -> None:
    words = ("dataset", "attributes", night_clip, "--json", "--rules", "lasot", "--per-frame")
    status, out, _ = cli(*words, "--rule-option", "low_area=300", "--every", "4")
    document = json.loads(out)
    assert status == 0
    assert document["provenance"] == "computed"
    assert document["rules"]["low_area"] == 300
    narrow = document["sequences"][0]
    assert narrow["sequence"] == "narrow"
    assert narrow["frames_looked_at"] == 2
    assert 0 in narrow["frames"]["LR"]


def test_attributes_in_files(night_clip: Path, tmp_path: Path, cli: Any) -> None:
    words = ("dataset", "attributes", night_clip, "--no-pixels", "--out")
    assert cli(*words, tmp_path / "a.csv")[0] == 0
    rows = list(csv.DictReader((tmp_path / "a.csv").open()))
    assert next((row["sequence"], row["provenance"]) for row in rows) == ("narrow", "computed")
    assert "UL" not in rows[0]
    assert cli(*words, tmp_path / "b.csv", "--per-frame")[0] == 0
    assert len((tmp_path / "b.csv").read_text().splitlines()) == 1 + 3 * 8
    assert cli(*words, tmp_path / "c.json")[0] == 0
    assert len(json.loads((tmp_path / "c.json").read_text())["sequences"]) == 3


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--rules", "uav12"), "no attribute rules 'uav12'; closest: uav123"),
        (("--rule-option", "area=3"), "no option 'area'"),
        (("--rule-option", "low_area"), "--rule-option 'low_area': expected KEY=VALUE"),
        (("--out", "a.txt"), "ends in .csv or .json"),
        (("--per-frame",), "--per-frame needs --out FILE or --json"),
        (("--every", "0"), "--every"),
    ],
)
def test_wrong_words_are_one_line(
    night_clip: Path, cli: Any, words: tuple[str, ...], message: str
) -> None:
    status, out, err = cli("dataset", "attributes", night_clip, *words)
    assert (status, out) == (2, "")
    assert message in err
    assert err.count("\n") == 1


def test_stats_writes_tables_and_figures(night_clip: Path, tmp_path: Path, cli: Any) -> None:
    status, out, err = cli("dataset", "stats", night_clip, "--out", tmp_path, "--every", "4")
    assert status == 0
    assert "3 sequences, 24 frames" in out
    assert str(tmp_path) in err
    names = {path.name for path in tmp_path.iterdir()}
    figures = ("lengths", "boxes", "centres", "light", "co_occurrence", "first_frames")
    assert names == {
        *(f"{name}.{kind}" for name in figures for kind in ("pdf", "png")),
        *("sequences.csv", "attributes.csv", "co_occurrence.csv"),
        *("statistics.json", "statistics.md"),
    }
    document = json.loads((tmp_path / "statistics.json").read_text())
    assert document["summary"]["frames"] == 24
    assert document["summary"]["mean_grey"]["count"] == 6
    assert all(path.stat().st_size > 100 for path in tmp_path.iterdir())


def test_stats_without_pixels_and_figures(night_clip: Path, tmp_path: Path, cli: Any) -> None:
    words = ("dataset", "stats", night_clip, "--out", tmp_path, "--no-pixels", "--no-figures")
    status, out, _ = cli(*words, "--json")
    assert status == 0
    document = json.loads(out)
    assert document["every"] == 0
    assert "light_spread" not in document["summary"]
    assert document["sequences"][0]["light_spread"] is None
    assert len(list(tmp_path.iterdir())) == 5


def test_scores_by_computed_attributes(
    night_clip: Path, tmp_path: Path, small_plugins: str, cli: Any
) -> None:
    words = ("--dataset", night_clip, "--results", tmp_path / "results", "--quiet")
    assert cli("run", "--tracker", "still", *words)[0] == 0
    words = ("eval", "--results", tmp_path / "results", "--by", "attribute")
    assert "computed" not in cli(*words)[1]
    status, out, _ = cli(*words, "--computed-attributes")
    assert status == 0
    assert "area<400" in out
    assert " computed " in out
    rows = json.loads(cli(*words, "--computed-attributes", "--json")[1])["per_attribute"]
    assert {row["provenance"] for row in rows} == {"computed"}
    small = next(row for row in rows if row["attribute"] == "area<400")
    assert small["sequences"] == 2


def test_published_and_computed_labels_stand_side_by_side(
    night_clip: Path, tmp_path: Path, cli: Any
) -> None:
    folder = tmp_path / "copy"
    shutil.copytree(night_clip, folder)
    (folder / "att").mkdir()
    for name in ("narrow", "tall", "wide"):
        (folder / "att" / f"{name}.txt").write_text("1,0\n")
    words = ("dataset", "attributes", folder, "--no-pixels", "--columns", "LR,OCC")
    status, out, _ = cli(*words, "--out", tmp_path / "a.csv")
    assert status == 0
    assert "LR: computed as published in 2 of 3" in out
    rows = list(csv.DictReader((tmp_path / "a.csv").open()))
    wide = {row["provenance"]: row for row in rows if row["sequence"] == "wide"}
    assert (wide["published"]["LR"], wide["computed"]["LR"]) == ("1", "0")
    assert (wide["published"]["OCC"], wide["computed"]["OCC"]) == ("0", "")
    status, _, err = cli("dataset", "stats", night_clip, "--out", tmp_path, "--columns", "LR,OCC")
    assert status == 2
    assert "no attribute file" in err


@pytest.fixture
def broken(night_clip: Path, tmp_path: Path) -> Path:
    """A copy of the clip in which one frame of `tall` is no image."""
    copy = Path(shutil.copytree(night_clip, tmp_path / "broken"))
    (copy / "data_seq" / "tall" / "00001.png").write_bytes(b"bad")
    return copy


def test_one_unreadable_frame_costs_only_its_own_sequence(
    broken: Path, tmp_path: Path, cli: Any
) -> None:
    out = tmp_path / "labels.csv"
    status, _, err = cli("dataset", "attributes", broken, "--out", out)
    assert status == 1
    assert "tall left out" in err
    assert {row["sequence"] for row in csv.DictReader(out.open())} == {"narrow", "wide"}
    status, _, err = cli("dataset", "stats", broken, "--out", tmp_path / "stats", "--no-figures")
    assert status == 1
    assert "tall left out" in err
    assert "wide" in (tmp_path / "stats" / "sequences.csv").read_text()


def test_eval_falls_back_to_what_boxes_tell(broken: Path, tmp_path: Path, cli: Any) -> None:
    words = ("run", "--tracker", "mil", "--dataset", broken, "--results", tmp_path / "r")
    assert cli(*words)[0] == 1
    status, out, err = cli("eval", "--results", tmp_path / "r", "--computed-attributes", "--json")
    assert status == 0
    assert "tall: attributes from boxes alone" in err
    assert json.loads(out)["per_attribute"]


def test_labels_stay_the_same_however_often_they_are_indexed(
    night_clip: Path, tmp_path: Path, cli: Any
) -> None:
    copy = Path(shutil.copytree(night_clip, tmp_path / "clip"))
    seen = []
    for _ in range(2):
        cli("dataset", "attributes", copy, "--out", tmp_path / "l.csv")
        words = ("dataset", "index", copy, "--force", "--attributes", tmp_path / "l.csv")
        assert cli(*words)[0] == 0
        seen.append((copy / "nat-bench.json").read_bytes())
    assert seen[0] == seen[1]
    assert b'"computed"' in seen[0]
    rows = list(csv.DictReader((tmp_path / "l.csv").open()))
    assert {row["provenance"] for row in rows} == {"computed"}


def test_a_manual_label_of_one_sequence_hides_no_computed_one(night_clip: Path) -> None:
    from dataclasses import replace

    import nat2024
    from nat2024.analysis import with_computed_attributes

    plain = nat2024.load_dataset(night_clip)
    before = {s.name: s.attributes for s in with_computed_attributes(plain, pixels=False)}
    name = next(a for a in before["wide"])
    first, *others = plain.sequences
    marked = replace(first, attributes=frozenset({name}), provenance={name: "manual"})
    after = with_computed_attributes(replace(plain, sequences=(marked, *others)), pixels=False)
    assert after["wide"].attributes == before["wide"]
    assert after[first.name].provenance[name] == "manual"


def test_skipped_frames_are_told_with_the_scores(
    night_clip: Path, tmp_path: Path, cli: Any
) -> None:
    copy = Path(shutil.copytree(night_clip, tmp_path / "skips"))
    (copy / "data_seq" / "tall" / "00004.png").write_bytes(b"bad")
    words = ("run", "--tracker", "mil", "--dataset", copy, "--results", tmp_path / "r")
    assert cli(*words, "--on-bad-frame", "skip")[0] == 0
    status, out, err = cli("eval", "--results", tmp_path / "r", "--json")
    assert status == 0
    assert json.loads(out)["notes"]["skips"]["skipped_frames"] == {"mil": {"tall": [3]}}
    assert "mil: 1 unreadable frames repeat the last box in tall" in err


def test_computed_labels_leave_with_the_boxes_that_they_came_from(
    night_clip: Path, tmp_path: Path, cli: Any
) -> None:
    copy = Path(shutil.copytree(night_clip, tmp_path / "clip"))
    cli("dataset", "attributes", copy, "--out", tmp_path / "l.csv", "--no-pixels")
    cli("dataset", "index", copy, "--attributes", tmp_path / "l.csv")
    (copy / "anno" / "wide.txt").write_text("10,10,80,80\n" * 8)
    status, _, err = cli("dataset", "index", copy, "--force")
    assert status == 0
    assert "wide: its boxes have changed, computed labels left out" in err
    index = json.loads((copy / "nat-bench.json").read_text())
    labels = {s["name"]: s.get("attributes", {}) for s in index["sequences"]}
    assert labels["wide"] == {}
    assert "computed" in labels["tall"].values()
