"""`nat-bench plot` as a user meets it, on boxes beside the truth of three rendered sequences."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import nat2024
from nat2024.store import RunFolder, Track


def write_run(folder: Path, dataset: Any, shift: float, *, leave_out: str = "") -> None:
    """Boxes that lie `shift` pixels, times their frame, beside the truth."""
    for sequence in dataset:
        if sequence.name != leave_out:
            boxes = sequence.boxes.copy()
            boxes[:, 0] += shift * np.arange(len(boxes))
            RunFolder(folder).write(sequence.name, Track(boxes, np.full((len(boxes), 3), 0.01)))


@pytest.fixture(scope="module")
def results(night_clip: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two trackers with and without `gamma`; one sequence of `kcf+gamma` is missing."""
    folder = tmp_path_factory.mktemp("plots") / "results"
    dataset = nat2024.load_dataset(str(night_clip))
    runs = folder / "night_clip"
    write_run(runs / "mosse", dataset, 2.0)
    write_run(runs / "mosse+gamma", dataset, 1.0)
    write_run(runs / "kcf", dataset, 1.5)
    write_run(runs / "kcf+gamma", dataset, 3.0, leave_out="wide")
    return folder


@pytest.fixture
def plot(cli: Any, results: Path, night_clip: Path, tmp_path: Path) -> Any:
    def call(*words: object, results: Path = results) -> tuple[int, str, str]:
        where = ("--results", results, "--dataset", night_clip, "--out", tmp_path / "out")
        return cli("plot", *where, *words)

    return call


def test_all_that_can_be_drawn_is_drawn(plot: Any, tmp_path: Path) -> None:
    kinds = ("curves", "attributes", "radar", "gains", "light", "error", "speed")
    words = [word for kind in kinds for word in ("--kind", kind)]
    status, out, err = plot(*words, "--format", "svg", "--json")
    assert status == 0
    found = json.loads(out)
    assert set(found) == {"out", "files", "remarks"}
    figures = {one["figure"]: one["kind"] for one in found["files"]}
    errors = {f"night_clip_error_{name}": "error" for name in ("narrow", "tall", "wide")}
    assert figures == {
        "night_clip_curves": "curves",
        "night_clip_bars": "curves",
        "night_clip_gains": "gains",
        **errors,
    }
    for one in found["files"]:
        assert set(one) == {"path", "format", "figure", "kind", "dataset", "caption"}
        assert Path(one["path"]).stat().st_size
        assert "protocol pysot" in one["caption"]
    assert {path.suffix for path in (tmp_path / "out").iterdir()} == {".svg", ".csv"}
    kinds = {remark["kind"] for remark in found["remarks"]}
    assert kinds == {"attributes", "radar", "gains", "light", "error", "speed"}
    for remark in found["remarks"]:
        assert remark["text"] in err


def test_the_same_results_give_the_same_bytes(plot: Any, tmp_path: Path) -> None:
    def files() -> dict[str, bytes]:
        return {path.name: path.read_bytes() for path in sorted((tmp_path / "out").iterdir())}

    assert plot("--kind", "gains", "--quiet")[0] == 0
    first = files()
    assert len(first) == 4
    assert plot("--kind", "gains", "--quiet")[0] == 0
    assert files() == first


def test_curves_lie_in_the_csv_with_their_names(
    plot: Any, results: Path, night_clip: Path, tmp_path: Path
) -> None:
    _, out, _ = plot("--kind", "curves", "--format", "svg")
    assert "with Gamma correction (solid) and without (dashed)" in out
    table = pd.read_csv(tmp_path / "out" / "night_clip_curves.csv")
    dataset = nat2024.load_dataset(str(night_clip))
    evaluation = nat2024.evaluate(results, dataset)
    assert set(table.tracker) == {"MOSSE", "KCF"}
    assert set(table[table.run == "kcf+gamma"].enhancer) == {"Gamma correction"}
    for (run, metric), curve in evaluation.curves().groupby(["run", "metric"]):
        mine = table[(table.run == run) & (table.metric == metric)]
        assert mine.threshold.tolist() == curve.threshold.tolist()
        assert mine.value.tolist() == curve.value.tolist()
    best = table[table.metric == "success"].iloc[0]
    assert best.score == evaluation.summary().success_auc.max()


def test_a_protocol_without_normalized_precision_leaves_it_out(plot: Any, tmp_path: Path) -> None:
    status, _, err = plot("--kind", "curves", "--format", "svg", "--protocol", "otb")
    assert status == 0
    assert "protocol otb defines no normalized precision" in err
    table = pd.read_csv(tmp_path / "out" / "night_clip_curves.csv")
    assert set(table.metric) == {"precision", "success"}


def test_only_what_is_asked_for(plot: Any, tmp_path: Path) -> None:
    words = ("--trackers", "kcf", "--sequence", "tall,wide", "--kind", "error", "--format", "svg")
    assert plot(*words)[0] == 0
    table = pd.read_csv(tmp_path / "out" / "night_clip_error_tall.csv")
    assert table.columns.tolist() == ["frame", "run", "tracker", "enhancer", "error"]
    assert set(table.run) == {"kcf", "kcf+gamma"}
    plain = table[table.run == "kcf"]
    assert plain.frame.tolist() == list(range(8))
    np.testing.assert_allclose(plain.error, 1.5 * np.arange(8), atol=1e-9)
    wide = pd.read_csv(tmp_path / "out" / "night_clip_error_wide.csv")
    assert set(wide.run) == {"kcf"}


def test_one_tracker_without_enhancer_has_curves_but_no_gains(plot: Any, cli: Any) -> None:
    status, _, err = plot("--trackers", "mosse", "--enhancers", "none", "--kind", "gains")
    assert status == 2
    assert "no run with an enhancer beside its tracker alone" in err
    words = ("--trackers", "mosse", "--enhancers", "none", "--kind", "curves", "--format", "svg")
    status, out, _ = plot(*words)
    assert status == 0
    assert "of trackers without an enhancer" in out


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--kind", "pie"], "'pie' is not one of 'curves', 'attributes'"),
        (["--format", "gif"], "--format 'gif': expected some of pdf, svg, png"),
        (["--format", ","], "expected some of pdf"),
        (["--trackers", "kfc"], "--trackers 'kfc': not in these results; closest: kcf"),
        (["--enhancers", "zzz"], "--enhancers 'zzz': not in these results; there are none, gamma"),
        (["--sequence", "tal"], "closest: tall"),
        (["--attribute", "IV"], "--attribute 'IV': not in these results; there are -"),
    ],
)
def test_wrong_words_are_refused_in_one_line(
    plot: Any, tmp_path: Path, words: list[str], told: str
) -> None:
    status, out, err = plot("--quiet", *words)
    assert status == 2
    assert out == ""
    assert told in err
    assert len(err.splitlines()) == 1
    assert not (tmp_path / "out").exists()


def test_no_results_and_no_place_for_figures(
    cli: Any, plot: Any, results: Path, tmp_path: Path
) -> None:
    status, _, err = cli("plot", "--results", tmp_path / "absent", "--out", tmp_path)
    assert status == 2
    assert "no such results folder" in err
    assert cli("plot", "--results", results)[0] == 2  # --out is missing
    (tmp_path / "out").write_text("a file")
    status, _, err = plot("--kind", "curves", "--format", "svg", "--quiet")
    assert status == 2
    assert len(err.splitlines()) == 1


def test_strange_names_are_drawn_as_they_are(plot: Any, night_clip: Path, tmp_path: Path) -> None:
    dataset = nat2024.load_dataset(str(night_clip))
    long = "a_very_long_name_of_a_tracker_that_nobody_can_read_" * 3
    for name in ("<script>alert(1)<", "$x^{$", "夜间 & _%", long):
        write_run(tmp_path / "r" / "night_clip" / name, dataset, 1.0)
    kinds = ("--kind", "curves", "--kind", "error", "--format", "svg")
    status, _, _ = plot(*kinds, "--sequence", "tall", "--quiet", results=tmp_path / "r")
    assert status == 0
    table = pd.read_csv(tmp_path / "out" / "night_clip_curves.csv")
    assert set(table.tracker) == {"<script>alert(1)<", "$x^{$", "夜间 & _%", long}
    svg = (tmp_path / "out" / "night_clip_curves.svg").read_text()
    assert "<script" not in svg
    assert len(list((tmp_path / "out").iterdir())) == 6
