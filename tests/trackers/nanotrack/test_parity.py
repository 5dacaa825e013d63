"""Against outputs and whole runs of the official code with the published weights."""

import json
from dataclasses import replace
from functools import cache

import cv2
import numpy as np
import pytest
import torch

import nat2024
from nat2024_trackers.siamese.state import Target

pytestmark = pytest.mark.shared

SMALL_MARGIN = 5e-5  # between the two best candidates: below it either may win
CASES = [(variant, kind) for variant in ("v1", "v2", "v3") for kind in ("plain", "gamma")]


@cache
def read_frames(folder):
    return [cv2.imread(str(path)) for path in sorted(folder.glob("*.png"))]


@pytest.fixture(scope="module")
def kit(shared):
    return shared / "parity" / "trackers"


@pytest.fixture(scope="module")
def make(kit, gamma):
    def create(variant, kind="plain", runtime="torch"):
        folder = kit / "nanotrack"
        weights = folder if runtime == "opencv" else folder / f"nanotrack{variant}.pth"
        enhancer = gamma(0.5) if kind == "gamma" else None
        return nat2024.create_tracker(
            "nanotrack", weights=weights, variant=variant, runtime=runtime, enhancer=enhancer
        )

    return create


def official(kit, variant, kind):
    run = json.loads((kit / "runs" / f"nanotrack{variant}_{kind}.json").read_text())
    return run, read_frames(kit / "clip_a")


@pytest.mark.parametrize("runtime", ["torch", "opencv"])
@pytest.mark.parametrize(("variant", "kind"), CASES)
def test_network_outputs(kit, make, variant, kind, runtime):
    pair = np.load(kit / "net" / f"nanotrack{variant}.npz")
    tracker = make(variant, kind, runtime)
    template, search = (torch.from_numpy(pair[name][None]) for name in ("template", "search"))
    maps = tracker._match([tracker._embed(template)], search)
    for found, name in zip(maps, ("cls", "loc"), strict=True):
        expected = pair[f"{'out' if kind == 'plain' else 'gamma'}_{name}"]
        assert found.shape[1:] == expected.shape
        assert np.abs(found[0] - expected).max() <= 2e-4 * max(1, np.abs(expected).max()), name


def follow(tracker, run, frames, *, atol):
    """Closed loop; a frame without a clear winner is a single step, and so is every other after."""
    first = tracker.init(frames[0], run["init_box"])
    np.testing.assert_array_equal(first, run["frames"][0]["bbox"])
    compared = 0
    for number, want in enumerate(run["frames"][1:], 1):
        row, score = tracker.update(frames[number])
        if want["margin"] < SMALL_MARGIN:
            tracker.target = Target(*want["state"])
            continue
        compared += 1
        step = tracker.last_step
        assert step.index == want["best_index"], number
        assert step.crop_side == want["crop_size"], number
        assert score == pytest.approx(want["best_score"], abs=1e-4)
        assert step.pscore == pytest.approx(want["best_pscore"], abs=1e-4)
        np.testing.assert_allclose(row, want["bbox"], atol=atol, rtol=0)
    return compared


@pytest.mark.parametrize(("variant", "kind"), CASES)
def test_tracked_runs(kit, make, variant, kind):
    run, frames = official(kit, variant, kind)
    compared = follow(make(variant, kind), run, frames, atol=2e-3)
    assert compared == (22 if (variant, kind) == ("v2", "plain") else 23)


@pytest.mark.parametrize("variant", ["v1", "v2", "v3"])
def test_tracked_runs_in_opencv(kit, make, variant):
    run, frames = official(kit, variant, "gamma")
    assert follow(make(variant, "gamma", "opencv"), run, frames, atol=2e-3) == 23


def test_single_steps_from_the_official_states(kit, make):
    run, frames = official(kit, "v2", "plain")
    tracker = make("v2")
    tracker.init(frames[0], run["init_box"])
    for number in range(12, 24, 3):
        want = run["frames"][number]
        assert want["margin"] >= SMALL_MARGIN
        tracker.target = Target(*run["frames"][number - 1]["state"])
        row, _ = tracker.update(frames[number])
        assert tracker.last_step.index == want["best_index"], number
        np.testing.assert_allclose(row, want["bbox"], atol=1e-3, rtol=0)


@pytest.mark.parametrize("runtime", ["torch", "opencv"])
def test_a_batch_of_several_sequences_equals_each_alone(kit, make, runtime):
    run, frames = official(kit, "v3", "plain")
    tracker = make("v3", runtime=runtime)
    box = np.array(run["init_box"], dtype=np.float64)
    firsts, targets = zip(*(tracker.begin(frames[number], box) for number in range(3)), strict=True)
    # Where the target is not in the middle of what is searched, another cell wins.
    targets = [
        replace(target, center_x=target.center_x + 30 * number)
        for number, target in enumerate(targets)
    ]
    images = frames[1:4]
    together = tracker.update_many(images, firsts, targets)
    assert len({step.index for step in together}) > 1
    for image, first, target, step in zip(images, firsts, targets, together, strict=True):
        [alone] = tracker.update_many([image], [first], [target])
        assert alone.index == step.index
        np.testing.assert_allclose(alone.box, step.box, atol=0.0 if runtime == "opencv" else 1e-3)
