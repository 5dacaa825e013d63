"""Verbs that score results need no frames, and say so where there are none."""

import json
import shutil
from pathlib import Path
from typing import Any

import pytest


@pytest.fixture
def bare(night_clip: Path, tmp_path: Path, small_plugins: str, cli: Any) -> tuple[Path, Path]:
    """A dataset and results of it; its images went after the run."""
    clip, results = tmp_path / "night_clip", tmp_path / "results"
    shutil.copytree(night_clip, clip)
    words = ("--tracker", "still", "--enhancer", "none", "--enhancer", "gamma", "--quiet")
    assert cli("run", *words, "--dataset", clip, "--results", results)[0] == 0
    return clip, results


def remove_images(clip: Path) -> None:
    images = [path for path in clip.rglob("*") if path.suffix in (".jpg", ".png")]
    assert images
    for path in images:
        path.unlink()


def test_scores_are_those_with_frames(bare: tuple[Path, Path], cli: Any, tmp_path: Path) -> None:
    clip, results = bare
    _, wanted, _ = cli("eval", "--results", results, "--json")
    remove_images(clip)
    for more in ((), ("--dataset", clip)):
        status, out, err = cli("eval", "--results", results, "--json", *more)
        assert (status, out) == (0, wanted)
        assert "night_clip: no frames of any sequence, scores need none" in err
    only = tmp_path / "elsewhere" / "anno"
    only.mkdir(parents=True)
    for file in sorted(clip.rglob("*.txt")):
        name = file.stem if file.stem in ("narrow", "tall", "wide") else file.parent.name
        shutil.copy(file, only / f"{name}.txt")
    words = ("--results", results / "night_clip", "--dataset", only, "--json")
    status, out, _ = cli("table", *words)
    rows, expected = json.loads(out)["summary"], json.loads(wanted)["summary"]
    assert status == 0
    for row, other in zip(rows, expected, strict=True):
        assert {**row, "dataset": ""} == {**other, "dataset": ""}


def test_what_looks_at_frames_leaves_them_out(
    bare: tuple[Path, Path], cli: Any, tmp_path: Path
) -> None:
    clip, results = bare
    remove_images(clip)
    status, out, _ = cli("table", "--results", results, "--layout", "failures")
    assert status == 0
    assert "no readable images of any sequence" in out
    words = ("--kind", "curves", "--kind", "losses", "--format", "svg", "--out", tmp_path / "figs")
    status, _, err = cli("plot", "--results", results, *words)
    assert status == 0
    assert list((tmp_path / "figs").glob("*.svg"))
    assert err.count("scores need none") <= 2  # for the scores and for what looks at frames
    page = tmp_path / "page"
    assert cli("report", "--results", results, "--out", page)[0] == 0
    assert "no readable images of any sequence" in (page / "index.html").read_text()


def test_results_are_exported_without_frames(
    bare: tuple[Path, Path], cli: Any, tmp_path: Path
) -> None:
    clip, results = bare
    remove_images(clip)
    words = ("--dataset", clip, "--format", "pysot", "--out", tmp_path / "exported")
    status, _, err = cli("export", "--results", results, *words)
    assert status == 0
    assert "night_clip: no frames of any sequence" in err
    assert list((tmp_path / "exported").rglob("narrow.txt"))


def test_frames_that_are_needed_are_one_line(bare: tuple[Path, Path], cli: Any) -> None:
    clip, results = bare
    remove_images(clip)
    status, out, err = cli("eval", "--results", results, "--protocol", "got10k-ao")
    assert (status, out) == (2, "")
    assert "narrow: its frames are not there, and this needs their size" in err
    again = ("run", "--tracker", "still", "--dataset", clip, "--results", results)
    assert cli(*again)[0] == 2
