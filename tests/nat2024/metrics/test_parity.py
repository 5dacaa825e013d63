"""Every curve of the reference toolkits' kits, and the scores over data sets and attributes."""

import json
import zipfile
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from nat2024.boxes import parse_boxes
from nat2024.errors import ArrayContract, LengthMismatch
from nat2024.metrics import Protocol, SequenceScores, evaluate_boxes, summarize

pytestmark = pytest.mark.shared

KITS = ["dtb70", "uav123", "uavdark135_reference"]
GOT10K_CLASS = {"dtb70": "dtb70", "uav123": "uav123", "uavdark135_reference": "otb"}
CURVES = {
    "success": "success_curve",
    "precision": "precision_curve",
    "norm_precision": "normalized_precision_curve",
}
SCORES = {
    "success_auc": lambda s: s.success_auc,
    "success_rate_at_0_5": lambda s: s.success_curve[10],
    "precision_at_20": lambda s: s.precision_20,
    "norm_precision_at_0_2": lambda s: s.normalized_precision_20,
    "norm_precision_auc": lambda s: s.normalized_precision_auc,
    "op50": lambda s: s.success_rate_50,
    "op75": lambda s: s.success_rate_75,
    "mean_overlap_over_valid": lambda s: s.average_overlap,
}
CASES = [
    "identical",
    "ordinary",
    "first_frame_half_pixel",
    "gt_nan_rows",
    "gt_zero_rows",
    "gt_zero_size_nonzero_xy",
    "gt_zero_height",
    "gt_negative_width",
    "gt_outside_left",
    "gt_touching_origin",
    "res_nan_row",
    "res_zero_row",
    "res_negative_size",
    "res_inf_row",
    "res_shorter",
    "res_longer",
    "res_one_short",
    "one_frame",
    "two_frames_second_absent",
    "all_absent",
    "first_frame_absent",
    "iou_on_thresholds",
    "distance_on_thresholds",
    "norm_distance_on_thresholds",
    "float_vs_int",
    "far_coordinates",
    "frozen_result",
    "absent_flags",
    "empty_result",
    "tiny_boxes",
]


@dataclass
class Kit:
    folder: Path
    name: str

    def __post_init__(self) -> None:
        with zipfile.ZipFile(self.folder / f"{self.name}.zip") as archive:
            boxes = {
                name: parse_boxes(archive.read(name), name)
                for name in archive.namelist()
                if name.startswith(("anno/", "results/"))
            }
        self.curves = np.load(self.folder / f"{self.name}_expected.npz")
        self.scores = json.loads((self.folder / f"{self.name}_expected.json").read_text())
        self.trackers = [str(name) for name in self.curves["trackers"]]
        self.sequences = [str(name) for name in self.curves["sequences"]]
        self.truths = {name: boxes[f"anno/{name}.txt"] for name in self.sequences}
        self.results = {
            (tracker, name): boxes[f"results/{tracker}/{name}.txt"]
            for tracker in self.trackers
            for name in self.sequences
        }

    def evaluate(self, tracker: str, protocol: str | Protocol) -> dict[str, SequenceScores]:
        return {
            name: evaluate_boxes(
                self.results[tracker, name], self.truths[name], protocol=protocol, name=name
            )
            for name in self.sequences
        }

    def check_curves(self, protocol: str | Protocol, expected: dict[str, np.ndarray], tolerance):
        for index, tracker in enumerate(self.trackers):
            scores = self.evaluate(tracker, protocol).values()
            for metric, values in expected.items():
                ours = np.array([getattr(one, CURVES[metric]) for one in scores])
                np.testing.assert_allclose(ours, values[index], rtol=0, atol=tolerance)

    def check_scores(self, key: str, protocol: str | Protocol) -> None:
        for tracker, expected in self.scores["protocols"][key].items():
            scores = self.evaluate(tracker, protocol)
            check(expected["overall"], summarize(scores.values()), 1e-12)
            for attribute, values in expected.get("attributes", {}).items():
                names = self.scores["attribute_sequences"][attribute]
                check(values, summarize(scores[name] for name in names), 1e-12)


def check(expected: dict[str, float], ours, tolerance: float) -> None:
    for key, value in expected.items():
        if key == "n_sequences":
            assert ours.sequences == value
        else:
            assert SCORES[key](ours) == pytest.approx(value, rel=0, abs=tolerance), key


@cache
def load(folder: Path, name: str) -> Kit:
    return Kit(folder, name)


@pytest.fixture(params=KITS)
def kit(request, shared: Path) -> Kit:
    return load(shared / "parity" / "metrics", request.param)


@pytest.fixture(scope="module")
def cases(shared: Path) -> dict:
    text = (shared / "parity" / "metrics" / "hardcases.json").read_text()
    return json.loads(text)["cases"]


def test_pysot_curves(kit: Kit) -> None:
    expected = {metric: kit.curves[f"pysot_{metric}"] for metric in CURVES}
    kit.check_curves("pysot", expected, 1e-12)


def test_got10k_curves(kit: Kit) -> None:
    protocol = Protocol("got10k-ope", invalid_rule=GOT10K_CLASS[kit.name])
    expected = {metric: kit.curves[f"got10k_{metric}"] for metric in ("success", "precision")}
    kit.check_curves(protocol, expected, 1e-12)
    normalized = {"norm_precision": kit.curves["got10k_norm_precision"]}
    kit.check_curves(Protocol("got10k-ope", invalid_rule="lasot"), normalized, 1e-12)


@pytest.mark.parametrize("name", ["otb", "lasot"])
def test_matlab_curves(kit: Kit, name: str) -> None:
    expected = {m: kit.curves[f"otb_matlab_{m}"] for m in ("success", "precision")}
    if name == "lasot":
        expected["norm_precision"] = kit.curves["lasot_matlab_norm_precision"]
    kit.check_curves(name, expected, 1e-12)


@pytest.mark.parametrize(
    ("kit_name", "label"), [("dtb70", "uav"), ("dtb70", "other"), ("uav123", "uav")]
)
def test_pytracking_curves(shared: Path, kit_name: str, label: str) -> None:
    kit = load(shared / "parity" / "metrics", kit_name)
    stored = np.load(kit.folder / f"{kit_name}_pytracking_expected.npz")
    assert list(stored["trackers"]) == kit.trackers
    assert list(stored["sequences"]) == kit.sequences
    prefix = f"dataset_{label}_exclude_invalid_false"
    expected = {metric: stored[f"{prefix}_{metric}"] for metric in CURVES}
    kit.check_curves(Protocol("pytracking", label=label), expected, 1e-6)


@pytest.mark.parametrize(
    ("key", "name"),
    [("pysot", "pysot"), ("otb_matlab", "otb"), ("lasot_matlab_no_absent", "lasot")],
)
def test_scores_of_data_sets_and_attributes(kit: Kit, key: str, name: str) -> None:
    kit.check_scores(key, name)


def test_got10k_scores_of_data_sets_and_attributes(kit: Kit) -> None:
    kit.check_scores("got10k", Protocol("got10k-ope", invalid_rule=GOT10K_CLASS[kit.name]))


@pytest.mark.parametrize("kit_name", ["dtb70", "uav123"])
def test_pytracking_scores(shared: Path, kit_name: str) -> None:
    kit = load(shared / "parity" / "metrics", kit_name)
    for key, trackers in kit.scores["protocols"]["pytracking"].items():
        _, label, *_, excluded = key.split("_")
        protocol = Protocol("pytracking", label=label, exclude_invalid=excluded == "true")
        for tracker, expected in trackers.items():
            check(expected, summarize(kit.evaluate(tracker, protocol).values()), 1e-6)


def test_no_hard_case_is_forgotten(cases: dict) -> None:
    assert sorted(cases) == sorted(CASES)


@pytest.mark.parametrize("name", CASES)
def test_hard_case(cases: dict, name: str) -> None:
    case = cases[name]
    expected = case["expected"]
    check_case(case, expected["pysot"], "pysot", 1e-12)
    for data_set, values in expected["got10k"].items():
        check_case(case, values, Protocol("got10k-ope", invalid_rule=data_set), 1e-12)
    for label, values in expected["pytracking"].items():
        check_case(case, values, Protocol("pytracking", label=label), 1e-6)


def check_case(case: dict, expected: dict, protocol: str | Protocol, tolerance: float) -> None:
    truth, predicted = numbers(case["gt"]), numbers(case["result"])
    flags = case.get("absent_flag")
    visible = None if flags is None or protocol != "pysot" else np.array(flags) == 1
    curves = {m: v for m, v in expected.items() if m in CURVES and isinstance(v, list)}
    if not curves:
        with pytest.raises((ArrayContract, LengthMismatch)):
            evaluate_boxes(predicted, truth, visible=visible, protocol=protocol)
        return
    truth.setflags(write=False)
    predicted.setflags(write=False)
    scores = evaluate_boxes(predicted, truth, visible=visible, protocol=protocol)
    for metric, values in curves.items():
        ours = getattr(scores, CURVES[metric])
        np.testing.assert_allclose(ours, numbers(values), rtol=0, atol=tolerance)


def numbers(rows: list) -> np.ndarray:
    array = np.array(rows, dtype=object)
    return array.astype(np.float64) if array.size else np.empty((0, 4))
