"""All Siamese trackers with procedural weights against the official code with the same weights.

A tracker is one row of `ROWS`. Each run of the official code is followed from its start for as many
updates as the time allows; later frames are single steps from the official state before them.
"""

import json
from dataclasses import dataclass
from functools import cache

import cv2
import numpy as np
import pytest
import torch

import nat2024
from nat2024_trackers.siamese.state import Target

pytestmark = pytest.mark.shared

SMALL_MARGIN = 5e-5  # between the two best candidates: below it either may win


@dataclass(frozen=True)
class Row:
    """A tracker of the table.

    Attributes:
        name: of the tracker.
        kit: name of the official runs.
        outputs: what the network gives, in its order, under the names of the official code.
        updates: how many are followed from the start of a run, of 23.
        every: of the frames after them, every how many-th is a single step.
        variant: of the tracker, None where there is only one.
        runs: which official runs there are.
        slow: takes more than ten seconds.
    """

    name: str
    kit: str
    outputs: tuple[str, ...]
    updates: int = 8
    every: int = 4
    variant: str | None = None
    runs: tuple[str, ...] = ("plain", "gamma")
    slow: bool = False


ROWS = [
    Row("siamrpnpp", "siamrpn_alex_dwxcorr", ("cls", "loc"), variant="alex"),
    Row(
        "siamrpnpp",
        "siamrpn_mobilev2_l234_dwxcorr",
        ("cls", "loc"),
        variant="mobilev2",
        updates=5,
        every=9,
    ),
    Row(
        "siamrpnpp",
        "siamrpn_r50_l234_dwxcorr",
        ("cls", "loc"),
        variant="r50",
        updates=5,
        every=9,
        slow=True,
    ),
    Row("siamapn", "siamapn", ("cls1", "cls2", "cls3", "loc", "anchors")),
    Row("siamapnpp", "siamapnpp", ("cls1", "cls2", "cls3", "loc", "anchors")),
    Row("hift", "hift", ("cls1", "cls2", "loc"), updates=6, every=6),
    Row(
        "lpat",
        "lpat",
        ("cls2", "cls3", "loc"),
        updates=6,
        every=6,
        runs=("plain", "gamma", "gamma_search_only"),
    ),
]
CASES = [
    pytest.param((row, run), marks=[pytest.mark.slow] if row.slow else [], id=f"{row.kit}-{run}")
    for row in ROWS
    for run in row.runs
]


@cache
def read_frames(folder):
    return [cv2.imread(str(path)) for path in sorted(folder.glob("*.png"))]


@pytest.fixture(scope="module")
def kit(shared):
    return shared / "parity" / "trackers"


@pytest.fixture(scope="module", params=CASES)
def case(request):
    return request.param


@pytest.fixture(scope="module")
def official(kit, case):
    """The official run, and its frames."""
    row, run = case
    found = json.loads((kit / "runs" / f"{row.kit}.{run}.json").read_text())
    return found, read_frames(kit / found["clip"])


@pytest.fixture(scope="module")
def tracker(kit, case, official, procedural_state, gamma):
    row, run = case
    options = {} if row.variant is None else {"variant": row.variant}
    made = nat2024.create_tracker(
        row.name,
        weights=False,
        enhancer=None if run == "plain" else gamma(0.5),
        enhance_template=run != "gamma_search_only",
        **options,
    )
    recipe = json.loads((kit / "weights" / official[0]["weights"].rsplit("/")[-1]).read_text())
    made.model.load_state_dict(procedural_state(recipe))
    return made


def test_network_outputs(kit, case, tracker):
    row, run = case
    if run not in ("plain", "gamma"):
        pytest.skip("the same network as in the run 'gamma'")
    pair = np.load(kit / "net" / f"{row.kit}.{run}.npz")
    template, search = (torch.from_numpy(pair[name][None]) for name in ("template", "search"))
    maps = tracker._match([tracker._embed(template)], search)
    assert len(maps) == len(row.outputs)
    for found, name in zip(maps, row.outputs, strict=True):
        expected = pair[f"out_{name}"]
        assert found.shape[1:] == expected.shape
        limit = 2e-4 * max(1, np.abs(expected).max())
        assert np.abs(found[0] - expected).max() <= limit, name


def compare(step, score, want, *, atol):
    assert step.index == want["best_index"], want["frame"]
    assert step.crop_side == want["crop_size"], want["frame"]
    assert score == pytest.approx(want["best_score"], abs=1e-4)
    assert step.pscore == pytest.approx(want["best_pscore"], abs=1e-4)
    np.testing.assert_allclose(step.box, want["bbox"], atol=atol)


def test_tracked_runs(case, tracker, official):
    run, frames = official
    first = tracker.init(frames[0], run["init_box"])
    np.testing.assert_array_equal(first, run["frames"][0]["bbox"])
    for number in range(1, 1 + case[0].updates):
        want = run["frames"][number]
        # Another winner would be as right here, and end the comparison of the run.
        assert want["margin"] >= SMALL_MARGIN, "follow fewer updates"
        _, score = tracker.update(frames[number])
        compare(tracker.last_step, score, want, atol=2e-3)


def test_single_steps_from_the_official_states(case, tracker, official):
    run, frames = official
    tracker.init(frames[0], run["init_box"])
    later = range(len(frames) - 1, case[0].updates, -case[0].every)
    chosen = [number for number in later if run["frames"][number]["margin"] >= SMALL_MARGIN]
    assert chosen
    for number in chosen:
        tracker.target = Target(*run["frames"][number - 1]["state"])
        _, score = tracker.update(frames[number])
        compare(tracker.last_step, score, run["frames"][number], atol=1e-3)


@pytest.mark.parametrize("name", sorted({row.kit for row in ROWS if not row.slow}))
def test_the_formula_gives_the_official_weights(kit, procedural_state, name):
    known = json.loads((kit / "checks.json").read_text())[f"{name}.plain"]
    recipe = json.loads((kit / "weights" / f"{name}.plain.json").read_text())
    assert set(known) <= set(recipe["tensors"])
    sources = {recipe["tensors"][key].get("same_as", key) for key in known}
    needed = {key: recipe["tensors"][key] for key in sources | set(known)}
    state = procedural_state({"salt": recipe["salt"], "tensors": needed})
    for key, check in known.items():
        values = state[key].double().flatten()
        assert values[:3].tolist() == check["first"], key
        assert float(values.sum()) == pytest.approx(check["sum"], abs=1e-6), key
