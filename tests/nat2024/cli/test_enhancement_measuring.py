"""`nat-bench enhance` with the options that measure."""

import csv
import json
import sys
import types
from pathlib import Path

import cv2
import numpy as np
import pytest
import torch

from nat2024.cli import run
from nat2024.cli.enhancement_measuring import print_measures
from nat2024.enhancing.measuring import load_quality_metrics, mean_rows
from nat2024.errors import UsageError
from nat2024.measures.adaptivity import FIXED, UNTOLD
from nat2024.measures.enhancement import ENHANCEMENT_MEASURES, measure_enhancement
from nat2024.registry import create_enhancer
from nat2024.testing.enhancers import night_image


@pytest.fixture
def images(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[np.ndarray]:
    monkeypatch.chdir(tmp_path)
    found = [night_image(40, 56, seed) // (1 + seed) for seed in range(2)]
    for folder in ("night", "day"):
        Path(folder).mkdir()
    for number, image in enumerate(found):
        cv2.imwrite(f"night/{number}.png", image)
        cv2.imwrite(f"day/{number}.png", np.minimum(image.astype(int) * 2, 255).astype(np.uint8))
    return found


def enhance(*words: str, status: int = 0) -> None:
    assert run(["enhance", "night", "--out", "out", "--quiet", *words]) == status


def test_json_has_rows_means_and_adaptivity(images, capsys):
    enhance("--enhancer", "gamma,clahe", "--measure", "--reference", "day", "--json")
    found = json.loads(capsys.readouterr().out)
    assert [(row["enhancer"], row["image"]) for row in found["measures"]] == [
        (name, f"{number}.png") for name in ("gamma", "clahe") for number in range(2)
    ]
    after = create_enhancer("gamma").enhance(images[0], bgr=True)
    reference = cv2.imread("day/0.png")
    expected = measure_enhancement(images[0], after, reference).as_row()
    row = {key: found["measures"][0][key] for key in ENHANCEMENT_MEASURES}
    numbers = {key: np.nan if value is None else value for key, value in row.items()}
    assert numbers == pytest.approx(expected, nan_ok=True)
    assert found["means"][0]["mean_after"] == pytest.approx(
        np.mean([row["mean_after"] for row in found["measures"][:2]])
    )
    verdicts = {row["enhancer"]: row["verdict"] for row in found["adaptivity"]}
    assert verdicts == {"gamma": FIXED, "clahe": UNTOLD}


def test_the_table_names_measures_and_verdicts(images, capsys):
    enhance("--enhancer", "gamma,none", "--measure")
    text = capsys.readouterr().out
    assert "over enhanced" in text
    assert "psnr" not in text  # nothing to compare with
    assert "gamma: a fixed tone curve" in text
    assert "none: no effect" in text
    assert max(map(len, text.splitlines())) <= 100


def test_only_explained_shares_near_one_have_six_places(capsys):
    row = {"enhancer": "a", "images": 2, "explained": 0.99895, "verdict": "x"}
    means = [{"enhancer": "a", "images": 2, "noise_gain": 0.996506}]
    print_measures({"means": means, "adaptivity": [row]})
    text = capsys.readouterr().out
    assert "0.998950" in text
    assert " 0.9965 " in text


def test_what_is_there_already_is_measured_as_well(images, capsys):
    enhance("--enhancer", "gamma", "--measure", "--json")
    first = json.loads(capsys.readouterr().out)
    enhance("--enhancer", "gamma", "--measure", "--json")
    second = json.loads(capsys.readouterr().out)
    assert second["measures"] == first["measures"]


def test_nothing_is_measured_unasked(images, capsys):
    enhance("--enhancer", "gamma", "--json")
    assert "measures" not in json.loads(capsys.readouterr().out)


def test_the_fitted_curve_does_what_the_enhancer_did(images, capsys):
    enhance("--enhancer", "gamma", "--fit-curve", "curve.safetensors")
    enhance("--enhancer", "tone_curve", "--weights", "tone_curve=curve.safetensors")
    for number in range(2):
        one, other = (cv2.imread(f"out/{name}/{number}.png") for name in ("gamma", "tone_curve"))
        assert np.array_equal(one[2:-2, 2:-2], other[2:-2, 2:-2])


def test_a_curve_is_of_channels_as_they_were_fed(images, capsys, tmp_path):
    levels = np.arange(256) / 255
    from nat2024.zoo.curve_files import write_tone_curve

    write_tone_curve(np.stack([levels, levels**0.5, levels**0.25]), "known.safetensors")
    for feed in ("image", "tracker"):
        words = ("--enhancer", f"tone_curve@{feed}", "--weights")
        words += (f"tone_curve@{feed}=known.safetensors", "--feed", feed)
        enhance(*words, "--fit-curve", f"{feed}.safetensors")
        curve = create_enhancer("tone_curve", weights=f"{feed}.safetensors").model.curve.numpy()
        assert curve[:, 30] == pytest.approx([30 / 255, (30 / 255) ** 0.5, (30 / 255) ** 0.25])


def test_rows_of_all_images_as_csv(images, capsys):
    enhance("--enhancer", "gamma", "--measure", "--measure-csv", "rows.csv")
    with Path("rows.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["image"] for row in rows] == ["0.png", "1.png"]
    assert list(rows[0]) == ["enhancer", "image", *ENHANCEMENT_MEASURES]
    assert float(rows[0]["mean_before"]) == pytest.approx(images[0].mean() / 255)
    assert rows[0]["psnr"] == "nan"


def test_an_image_without_reference_is_named(images, capsys):
    Path("day/1.png").unlink()
    enhance("--enhancer", "gamma", "--measure", "--reference", "day", "--json", status=1)
    found = json.loads(capsys.readouterr().out)
    assert [failure["image"] for failure in found["failures"]] == ["1.png"]
    assert "no such reference" in found["failures"][0]["reason"]
    assert len(found["measures"]) == 1


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--enhancer", "gamma", "--reference", "day"), "belong to --measure"),
        (("--enhancer", "gamma", "--measure", "--reference", "no"), "no such folder of references"),
        (("--enhancer", "gamma,he", "--fit-curve", "a.safetensors"), "the curve of one enhancer"),
        (("--enhancer", "gamma", "--fit-curve", "a.pth"), "must end in .safetensors"),
    ],
)
def test_options_that_do_not_fit_are_one_line(images, capsys, words, message):
    enhance(*words, status=2)
    text = capsys.readouterr().err.strip()
    assert message in text
    assert "\n" not in text
    assert not Path("out").exists()


def test_images_of_one_pixel_have_measures_but_no_adaptivity(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("night").mkdir()
    cv2.imwrite("night/a.png", np.full((1, 1, 3), 9, np.uint8))
    enhance("--enhancer", "gamma", "--measure", "--json")
    found = json.loads(capsys.readouterr().out)
    assert found["adaptivity"] == []
    assert found["measures"][0]["mean_before"] == pytest.approx(9 / 255)
    enhance("--enhancer", "gamma", "--fit-curve", "a.safetensors", status=2)
    assert "no curve to write" in capsys.readouterr().err


class FakeMetric:
    def __init__(self, mode: str) -> None:
        self.metric_mode = mode

    def __call__(self, *batches: torch.Tensor) -> torch.Tensor:
        return sum(batch[:, 0].mean() for batch in batches)


def test_metrics_of_pyiqa_get_rgb_and_the_reference(monkeypatch):
    library = types.ModuleType("pyiqa")
    modes = {"niqe": "NR", "lpips": "FR"}
    library.list_models = lambda: list(modes)
    library.create_metric = lambda name, **_: FakeMetric(modes[name])
    monkeypatch.setitem(sys.modules, "pyiqa", library)
    metrics = load_quality_metrics(["niqe", "lpips"])
    image = np.zeros((4, 5, 3), np.uint8)
    image[..., 2] = 51  # red
    assert metrics["niqe"](image, None) == pytest.approx(0.2)
    assert metrics["lpips"](image, image) == pytest.approx(0.4)
    with pytest.raises(UsageError, match="compares with a reference"):
        metrics["lpips"](image, None)
    with pytest.raises(UsageError, match="no metric 'nique'"):
        load_quality_metrics(["nique"])


def test_absent_pyiqa_is_one_line_that_says_how_to_get_it(images, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyiqa", None)
    enhance("--enhancer", "gamma", "--measure", "--quality-metric", "niqe", status=2)
    assert "pip install 'nat-bench[iqa]'" in capsys.readouterr().err


def test_means_are_by_enhancer():
    rows = [
        {"enhancer": "a", "image": "1", "x": 1.0},
        {"enhancer": "b", "image": "1", "x": 5.0},
        {"enhancer": "a", "image": "2", "x": 2.0},
    ]
    assert mean_rows(rows) == [
        {"enhancer": "a", "images": 2, "x": 1.5},
        {"enhancer": "b", "images": 1, "x": 5.0},
    ]
