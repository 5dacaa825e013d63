"""What holds for the trackers of vision4robotics alike, with weights from a formula."""

import copy
import json
import zlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import torch

import nat2024
from nat2024.errors import WeightsMismatch, WeightsMissing

DATA = Path(__file__).resolve().parents[2] / "data"


@dataclass(frozen=True)
class Row:
    """What is published of a tracker.

    Attributes:
        constants: penalty, window influence, learning rate.
        parameters: numbers in its network.
        entries: of its state dict.
        repository: of vision4robotics.
        relative: the tracker whose checkpoints are most like its own.
        large_target_share: above which the first frame's scale is searched.
        enhances_template: by default.
    """

    constants: tuple[float, float, float]
    parameters: int
    entries: int
    repository: str
    relative: str
    large_target_share: float | None = None
    enhances_template: bool = True


ROWS = {
    "siamapn": Row((0.08, 0.4364, 0.302), 15_149_005, 110, "SiamAPN", "siamapnpp"),
    "siamapnpp": Row((0.079, 0.44, 0.31), 15_373_971, 147, "SiamAPN", "siamapn"),
    "hift": Row((0.08, 0.42, 0.30), 11_066_312, 148, "HiFT", "lpat", 0.5),
    "lpat": Row((0.385, 0.205, 0.285), 10_077_847, 283, "LPAT", "hift", 0.5, False),
}


@pytest.fixture(scope="module", params=ROWS)
def name(request):
    return request.param


@pytest.fixture(scope="module")
def golden(name):
    return json.loads((DATA / f"{name}_golden.json").read_text())


@pytest.fixture(scope="module")
def recipe(name, golden, recipe_of):
    model = nat2024.create_tracker(name, weights=False).model
    return recipe_of(model, name, golden["special"])


@pytest.fixture(scope="module")
def state(recipe, procedural_state):
    return procedural_state(recipe)


@pytest.fixture(scope="module")
def loaded(name, state):
    """A tracker with these weights; tests may track with it and set its enhancer."""
    tracker = nat2024.create_tracker(name, weights=False)
    tracker.model.load_state_dict(state)
    return tracker


@pytest.fixture
def tracker(loaded):
    yield loaded
    loaded.enhancer = None


def test_entries_are_the_official_ones(name, golden, recipe):
    entries = [f"{key} {entry['shape']}" for key, entry in recipe["tensors"].items()]
    assert len(entries) == golden["entries"] == ROWS[name].entries
    assert zlib.crc32("\n".join(entries).encode()) == golden["entries_crc32"]


def test_the_network_has_the_published_size(name, tracker):
    assert sum(p.numel() for p in tracker.model.parameters()) == ROWS[name].parameters


def test_constants_of_the_official_configuration(name, tracker):
    constants = tracker.constants
    found = (constants.penalty_k, constants.window_influence, constants.learning_rate)
    assert found == ROWS[name].constants
    assert constants.ratio_epsilon == 1e-5
    assert constants.large_target_share == ROWS[name].large_target_share


@torch.no_grad()
def test_maps_have_the_golden_numbers(tracker, golden, crops):
    """Written by an implementation that equals the official code on the parity kit."""
    maps = tracker.model(*crops(1))
    for one, expected in zip(maps, golden["maps"], strict=True):
        found = one[0, :, ::5, ::5].flatten().numpy()
        np.testing.assert_allclose(found, expected, rtol=0, atol=2e-4)


def test_with_gradients_the_network_gives_the_same(tracker, golden, crops):
    maps = tracker.model(*crops(1))
    assert all(one.requires_grad for one in maps)
    for one, expected in zip(maps, golden["maps"], strict=True):
        found = one[0, :, ::5, ::5].flatten().detach().numpy()
        np.testing.assert_allclose(found, expected, rtol=0, atol=2e-4)


@pytest.mark.parametrize("run", ["plain", "gamma"])
def test_a_generated_clip_gives_the_golden_boxes(name, tracker, golden, clip, gamma, run):
    frames, box = clip
    tracker.enhancer = gamma(0.8) if run == "gamma" else None
    expected = golden[run]
    np.testing.assert_array_equal(tracker.init(frames[0], box), expected[0]["box"])
    for frame, want in zip(frames[1:], expected[1:], strict=False):
        row, score = tracker.update(frame)
        step = tracker.last_step
        assert step.index == want["index"]
        assert step.crop_side == want["crop_side"]
        assert score == pytest.approx(want["score"], abs=1e-4)
        assert step.pscore == pytest.approx(want["pscore"], abs=1e-4)
        np.testing.assert_allclose(row, want["box"], atol=0.01)
    if run == "gamma":
        template = [len(batch) for batch in tracker.enhancer.batches if batch.shape[-1] == 127]
        assert template == ([1] if ROWS[name].enhances_template else [])


def test_a_batch_of_sequences_equals_each_alone(tracker, clip):
    frames, box = clip
    later = box + np.array([12.0, -6, 0, 0])
    begun = [tracker.begin(frames[0], box), tracker.begin(frames[3], later)]
    images = [frames[1], frames[4]]
    together = tracker.update_many(images, [b[0] for b in begun], [b[1] for b in begun])
    for image, (first, target), step in zip(images, begun, together, strict=True):
        [alone] = tracker.update_many([image], [first], [target])
        assert alone.index == step.index
        np.testing.assert_allclose(alone.box, step.box, atol=1e-3)


def test_weights_loaded_later_count_from_the_next_init(name, tracker, clip, state):
    frames, box = clip
    other = nat2024.create_tracker(name, weights=False)
    other.init(frames[0], box)
    other.update(frames[1])
    other.model.load_state_dict(state)
    for one in (tracker, other):
        one.init(frames[0], box)
    np.testing.assert_array_equal(tracker.update(frames[1])[0], other.update(frames[1])[0])


@torch.no_grad()
def test_a_copy_of_the_network_follows_its_own_weights(tracker, crops):
    original = tracker.model(*crops(1))
    twin = copy.deepcopy(tracker.model)
    norm = next(m for m in twin.grader.modules() if isinstance(m, torch.nn.BatchNorm2d))
    norm.bias += 3
    moved = [(new - old).abs().max() for new, old in zip(twin(*crops(1)), original, strict=True)]
    assert max(moved) > 1e-2
    assert all(map(torch.equal, tracker.model(*crops(1)), original))


def test_official_checkpoint_forms_are_read(name, tmp_path, state):
    prefixed = {f"module.{key}": value for key, value in state.items()}
    content = {"state_dict": prefixed, "epoch": 70, "optimizer": {"lr": np.float64(0.1)}}
    torch.save(content, tmp_path / "first.pth")
    tracker = nat2024.create_tracker(name, weights=tmp_path / "first.pth")
    assert tracker.weights.origin == "given"
    for key, value in tracker.model.state_dict().items():
        assert torch.equal(value, state[key]), key


def test_a_checkpoint_of_the_other_network_is_refused_and_named(name, tmp_path, state):
    torch.save(state, tmp_path / "model.pth")
    with pytest.raises(WeightsMismatch, match=f"it looks like a checkpoint of {name}"):
        nat2024.create_tracker(ROWS[name].relative, weights=tmp_path / "model.pth")


def test_missing_weights_name_the_official_file_and_where_it_is(name):
    with pytest.raises(WeightsMissing) as caught:
        nat2024.create_tracker(name)
    message = str(caught.value)
    assert "general_model" in message
    assert f"vision4robotics/{ROWS[name].repository}" in message
    assert f"--weights {name}=PATH" in message
