"""`nat-bench table` in every layout, and what it says where there is little to show."""

import csv
import io
import json
import shutil
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

import nat2024
from nat2024.cli.ablations import ablations_of
from nat2024.evaluation import Evaluation, RunScores
from nat2024.metrics import Protocol
from nat2024.store import DatasetRecord, Manifest, PluginRecord, StageTimes

LENGTHS = {"bike1": 5, "bike10": 4, "bike2": 6, "car1": 5, "car2": 4, "car3": 3, "car4": 5}
SHIFTS = {"still": 12.0, "still+gamma": 6.0, "still+clahe": 11.5, "mil+gamma": 4.0}


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Sequences of cars and bikes."""
    import cv2

    root = tmp_path_factory.mktemp("data") / "clip"
    image = np.zeros((40, 60, 3), np.uint8)
    for name, length in LENGTHS.items():
        folder = root / "data_seq" / name
        folder.mkdir(parents=True)
        for number in range(length):
            cv2.imwrite(str(folder / f"{number + 1:05}.jpg"), image)
        nat2024.write_boxes(root / "anno" / f"{name}.txt", truth(length))
    return root


def truth(length: int) -> np.ndarray:
    boxes = np.full((length, 4), 20.0)
    boxes[:, 0] += np.arange(length)
    return boxes


@pytest.fixture
def results(dataset: Path, tmp_path: Path) -> Path:
    """Results that are off by so many pixels, two of them timed."""
    folder = tmp_path / "results" / "clip"
    for run, shift in SHIFTS.items():
        for number, (name, length) in enumerate(LENGTHS.items()):
            boxes = truth(length) + [shift + number % 2, 0, 0, 0]
            nat2024.write_boxes(folder / run / f"{name}.txt", boxes)
    for run, enhancer in (("still", None), ("still+gamma", PluginRecord("gamma"))):
        times = StageTimes(30, 0.001, 0.002 if enhancer else 0.0, 0.01, 0.5, 83.3, 76.9)
        record = DatasetRecord("clip", str(dataset))
        manifest = Manifest(
            dataset=record, tracker=PluginRecord("still"), enhancer=enhancer, timing=times
        )
        (folder / run / "run.json").write_bytes(msgspec.json.encode(manifest))
    return tmp_path / "results"


def table(cli: Any, results: Path, *words: object) -> tuple[int, str, str]:
    status, out, err = cli("table", "--results", results, *words)
    return status, out, err


def rows(out: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(out)))


def test_gains_and_doubts_reach_the_table(results: Path, cli: Any) -> None:
    status, out, _ = table(cli, results)
    assert status == 0
    assert max(map(len, out.splitlines())) <= 100
    cells = {tuple(line.split()[:2]): line.split() for line in out.splitlines() if line.strip()}
    gamma, clahe = cells["still", "gamma"], cells["still", "clahe"]
    assert "~" not in gamma[4]  # success: better in every sequence
    assert gamma[6] == clahe[6] == "~+0.000"  # precision: all within 20 px
    assert "~ may be noise: the interval of the gain over 7 sequences includes 0" in out
    assert "no gains of mil: not run without an enhancer" in out
    assert "Scope" in out  # one is told by its manifest, the others by nothing
    (gain,) = [
        row["gain"]
        for row in json.loads(table(cli, results, "--json")[1])["gains"]
        if (row["run"], row["metric"]) == ("still+gamma", "success_auc")
    ]
    assert gamma[4] == f"{gain:+.3f}"
    _, out, _ = table(cli, results, "--intervals")
    assert "[+" in out
    assert max(map(len, out.splitlines())) <= 100


@pytest.mark.parametrize(
    ("layout", "expected"),
    [
        ("enhancers", "Enhancers before still on clip: 7 sequences"),
        ("categories", "bike\n"),
        ("sequences", "bike10"),
        ("protocols", "got10k-ao: average overlap, not success"),
        ("speed", "no times stored of mil+gamma, still+clahe"),
    ],
)
@pytest.mark.parametrize("form", ["console", "html"])
def test_layouts(results: Path, cli: Any, layout: str, expected: str, form: str) -> None:
    status, out, _ = table(cli, results, "--layout", layout, "--format", form)
    assert status == 0
    assert expected.strip() in out
    if form == "console":
        assert max(map(len, out.splitlines())) <= 100
    else:
        assert out.startswith("<!doctype html>")


@pytest.mark.parametrize("layout", ["overall", "categories", "protocols"])
def test_printed_tables_have_the_names_of_papers(results: Path, cli: Any, layout: str) -> None:
    cells = {"latex": "& CLAHE &", "html": ">CLAHE<", "markdown": "| CLAHE |", "csv": ",clahe,"}
    for form, cell in cells.items():
        _, out, _ = table(cli, results, "--layout", layout, "--format", form)
        assert cell in out


def test_numbers_of_layouts(results: Path, cli: Any) -> None:
    _, out, _ = table(cli, results, "--layout", "categories", "--format", "csv")
    found = {(row["Tracker"], row["Enhancer"]): row for row in rows(out)}
    plain = found["still", "-"]
    assert 0 < float(plain["bike"]) < float(found["still", "gamma"]["bike"])
    assert float(found["still", "gamma"]["car gain %"]) > 0
    _, out, _ = table(cli, results, "--layout", "sequences", "--format", "csv")
    names = [row["Sequence"] for row in rows(out)]
    assert names == ["bike1", "bike2", "bike10", "car1", "car2", "car3", "car4", "mean"]
    sequences = [float(row["still"]) for row in rows(out)]
    assert sequences[-1] == pytest.approx(np.mean(sequences[:-1]))
    _, out, _ = table(cli, results, "--layout", "speed", "--format", "csv")
    assert {row["frames_per_second"] for row in rows(out)} == {"83.3", ""}
    _, out, _ = table(
        cli, results, "--layout", "sequences", "--score", "precision", "--format", "csv"
    )
    assert {row["still"] for row in rows(out)} == {"1.0"}  # 12 pixels off, and 20 allowed


def test_what_there_is_nothing_of_is_one_line(results: Path, cli: Any) -> None:
    status, _, err = table(cli, results, "--layout", "ablation")
    assert status == 2
    assert "clip: no run of a variant; label them ldenhancer@baseline" in err
    status, _, err = table(
        cli,
        results,
        "--layout",
        "sequences",
        "--score",
        "normalized_precision",
        "--protocol",
        "otb",
    )
    assert status == 2
    assert "protocol otb has no normalized_precision" in err
    for run in SHIFTS:
        if run != "still":
            shutil.rmtree(results / "clip" / run)
    status, out, _ = table(cli, results)
    assert status == 0  # one tracker only: no gains
    assert "+" not in out
    status, _, err = table(cli, results, "--layout", "enhancers")
    assert status == 2
    assert err.splitlines()[-1].endswith(
        "clip: no run with an enhancer; `nat-bench run --enhancer NAME`"
    )


def test_eval_by_category_or_by_what_nothing_tells(results: Path, cli: Any) -> None:
    status, out, _ = cli("eval", "--results", results, "--by", "category")
    assert status == 0
    assert {line.split()[0] for line in out.splitlines() if "still+gamma" in line} == {
        "bike",
        "car",
    }
    status, out, err = cli("eval", "--results", results, "--by", "attribute")
    assert (status, out) == (0, "")
    assert "clip: no sequence tells its attribute" in err


def test_attributes_published_or_computed(results: Path, cli: Any) -> None:
    status, _, err = table(cli, results, "--layout", "attributes")
    assert status == 2
    assert "clip: no sequence has an attribute; --computed-attributes computes some" in err
    words = ("--layout", "attributes", "--computed-attributes", "--intervals")
    status, out, _ = table(cli, results, *words)
    assert status == 0
    assert "* computed from boxes and frames, not published" in out
    assert max(map(len, out.splitlines())) <= 100


def test_no_manifest_no_results_and_strange_names(
    results: Path, dataset: Path, tmp_path: Path, cli: Any
) -> None:
    for manifest in results.glob("*/*/run.json"):
        manifest.unlink()
    status, _, err = table(cli, results)
    assert status == 2
    assert "name it with --dataset" in err
    (results / "clip" / "mil+gamma").rename(results / "clip" / "<script>")
    (results / "clip" / "<script>" / "car1.txt").unlink()
    words = ("--dataset", dataset, "--format", "html")
    status, out, err = table(cli, results, *words)
    assert status == 0
    assert "<script>" not in out
    assert "&lt;script&gt;" in out
    assert "no result of 1 sequence, car1" in err
    status, _, err = table(cli, results, "--dataset", dataset, "--layout", "speed")
    assert (status, err.splitlines()[-1]) == (
        2,
        "nat-bench: clip: no manifest tells how long a run took",
    )
    (tmp_path / "none").mkdir()
    status, _, err = table(cli, tmp_path / "none")
    assert status == 2
    assert "holds no results" in err


def run(enhancer: str, **options: Any) -> RunScores:
    record = PluginRecord(enhancer.partition("@")[0], options=options)
    manifest = Manifest(dataset=DatasetRecord("d"), tracker=PluginRecord("t"), enhancer=record)
    name = f"t+{enhancer}"
    return RunScores(name, "t", enhancer, "patch", {}, (), (), {}, 0.0, manifest)


def evaluation(*runs: RunScores) -> Evaluation:
    return Evaluation("d", Protocol("pysot"), runs)


def test_variants_are_told_by_label_or_options() -> None:
    whole = {"two_branch": True, "light_loss": True, "cross_attention": True}
    runs = [
        run("ldenhancer@baseline-2", **whole),  # a label that says so wins
        run("ldenhancer@Baseline_TB.seed1", **whole),
        run("ldenhancer@tb_ls", **whole),
        run("ldenhancer", **whole),
        run("ldenhancer@mine", **{**whole, "cross_attention": False}),
        run("ldenhancer@other", **{**whole, "light_loss": False}),  # no variant of the paper
        run("gamma", gamma=0.5),
        run("nobody_knows"),
    ]
    (found,) = ablations_of(evaluation(*runs))
    assert found.enhancer == "LDEnhancer"
    assert found.names == ["+Baseline", "+Baseline+TB", "+Baseline+TB+LS", "+Baseline+TB+LS+TF"]
    assert found.variants == {
        "t+ldenhancer@baseline-2": "+Baseline",
        "t+ldenhancer@Baseline_TB.seed1": "+Baseline+TB",
        "t+ldenhancer@tb_ls": "+Baseline+TB+LS",
        "t+ldenhancer": "+Baseline+TB+LS+TF",
        "t+ldenhancer@mine": "+Baseline+TB+LS",
    }
