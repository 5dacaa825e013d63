"""Against outputs and whole runs of the official code with the same procedural weights."""

import json
from functools import cache

import cv2
import numpy as np
import pytest

import nat2024
from nat2024_trackers.siamese.state import Target

pytestmark = pytest.mark.shared

NAMES = {
    "alex": "siamrpn_alex_dwxcorr",
    "mobilev2": "siamrpn_mobilev2_l234_dwxcorr",
    "r50": "siamrpn_r50_l234_dwxcorr",
}
SMALL_MARGIN = 5e-5
UPDATES = {"alex": 23, "mobilev2": 11, "r50": 5}  # all of the run, or what time allows
slow = pytest.mark.slow
ALL = [
    pytest.param(name, kind, marks=[slow] if name == "r50" else [], id=f"{name}-{kind}")
    for name in NAMES
    for kind in ("plain", "gamma")
]


@cache
def read_frames(folder):
    return [cv2.imread(str(path)) for path in sorted(folder.glob("*.png"))]


@pytest.fixture
def kit(shared):
    return shared / "parity" / "trackers"


@pytest.fixture
def make(kit, procedural_state, gamma):
    def create(name, kind):
        recipe = json.loads((kit / "weights" / f"{NAMES[name]}.{kind}.json").read_text())
        enhancer = gamma(0.5) if kind == "gamma" else None
        tracker = nat2024.create_tracker(
            "siamrpnpp", weights=False, variant=name, enhancer=enhancer
        )
        tracker.model.load_state_dict(procedural_state(recipe))
        return tracker

    return create


@pytest.mark.parametrize(("name", "kind"), ALL)
def test_network_outputs(kit, make, name, kind):
    pair = np.load(kit / "net" / f"{NAMES[name]}.{kind}.npz")
    tracker = make(name, kind)
    features = tracker._embed([pair["template"]])
    classes, offsets = tracker._match([features], [pair["search"]])
    for found, key in ((classes, "out_cls"), (offsets, "out_loc")):
        expected = pair[key]
        limit = 2e-4 * max(1, np.abs(expected).max())
        assert found.shape[1:] == expected.shape
        assert np.abs(found[0] - expected).max() <= limit


@pytest.mark.parametrize(("name", "kind"), ALL)
def test_tracked_runs(kit, make, name, kind):
    run = json.loads((kit / "runs" / f"{NAMES[name]}.{kind}.json").read_text())
    frames = read_frames(kit / run["clip"])
    tracker = make(name, kind)
    first = tracker.init(frames[0], run["init_box"])
    np.testing.assert_array_equal(first, run["frames"][0]["bbox"])
    followed = slice(1, 1 + UPDATES[name])
    for image, want in zip(frames[followed], run["frames"][followed], strict=True):
        row, score = tracker.update(image)
        step = tracker.last_step
        assert step.index == want["best_index"], want["frame"]
        assert step.crop_side == want["crop_size"], want["frame"]
        assert score == pytest.approx(want["best_score"], abs=1e-4)
        assert step.pscore == pytest.approx(want["best_pscore"], abs=1e-4)
        np.testing.assert_allclose(row, want["bbox"], atol=2e-3)


@pytest.mark.parametrize("kind", ["plain", "gamma"])
def test_single_steps_from_the_official_states(kit, make, kind):
    run = json.loads((kit / "runs" / f"{NAMES['alex']}.{kind}.json").read_text())
    frames = read_frames(kit / run["clip"])
    tracker = make("alex", kind)
    tracker.init(frames[0], run["init_box"])
    compared = 0
    for number in range(1, len(frames), 3):
        want = run["frames"][number]
        tracker.target = Target(*run["frames"][number - 1]["state"])
        row, _ = tracker.update(frames[number])
        if want["margin"] < SMALL_MARGIN:
            continue
        compared += 1
        assert tracker.last_step.index == want["best_index"], number
        np.testing.assert_allclose(row, want["bbox"], atol=1e-3)
    assert compared >= 6


def test_the_formula_gives_the_weights_of_the_kit(kit, procedural_state):
    known = json.loads((kit / "checks.json").read_text())["siamrpn_alex_dwxcorr.plain"]
    recipe = json.loads((kit / "weights" / "siamrpn_alex_dwxcorr.plain.json").read_text())
    state = procedural_state(recipe)
    assert known
    for key, check in known.items():
        values = state[key].double().flatten()
        assert values[:3].tolist() == check["first"], key
        assert float(values.sum()) == pytest.approx(check["sum"], abs=1e-6), key
