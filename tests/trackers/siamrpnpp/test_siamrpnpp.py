import json
from pathlib import Path

import numpy as np
import pytest
import torch

import nat2024
from nat2024.errors import InvalidOption, WeightsMismatch, WeightsMissing

DATA = Path(__file__).resolve().parents[2] / "data"


@pytest.fixture
def make(alex_state):
    def create(**options):
        tracker = nat2024.create_tracker("siamrpnpp", weights=False, **options)
        tracker.model.load_state_dict(alex_state)
        return tracker

    return create


@pytest.mark.parametrize("name", ["plain", "gamma"])
def test_a_generated_clip_gives_the_numbers_of_the_official_code(make, clip, gamma, name):
    """Written by an implementation that equals the official code on the parity kit."""
    expected = json.loads((DATA / "siamrpnpp_golden.json").read_text())[name]
    frames, box = clip
    tracker = make(enhancer=gamma(0.8) if name == "gamma" else None)
    np.testing.assert_array_equal(tracker.init(frames[0], box), expected[0]["box"])
    for frame, want in zip(frames[1:], expected[1:], strict=True):
        row, score = tracker.update(frame)
        step = tracker.last_step
        assert step.index == want["index"]
        assert step.crop_side == want["crop_side"]
        assert score == pytest.approx(want["score"], abs=1e-4)
        assert step.pscore == pytest.approx(want["pscore"], abs=1e-4)
        np.testing.assert_allclose(row, want["box"], atol=0.01)


def test_weights_loaded_later_count_from_the_next_init(make, clip, alex_state):
    frames, box = clip
    tracker = nat2024.create_tracker("siamrpnpp", weights=False)
    tracker.init(frames[0], box)
    tracker.update(frames[1])
    tracker.model.load_state_dict(alex_state)
    loaded = make()
    for one in (tracker, loaded):
        one.init(frames[0], box)
    np.testing.assert_array_equal(tracker.update(frames[1])[0], loaded.update(frames[1])[0])


def test_a_batch_of_two_sequences_equals_each_alone(make, clip):
    frames, box = clip
    tracker = make()
    later = box + np.array([12.0, -6, 0, 0])
    begun = [tracker.begin(frames[0], box), tracker.begin(frames[3], later)]
    images = [frames[1], frames[4]]
    together = tracker.update_many(images, [b[0] for b in begun], [b[1] for b in begun])
    for image, (first, target), step in zip(images, begun, together, strict=True):
        [alone] = tracker.update_many([image], [first], [target])
        assert alone.index == step.index
        np.testing.assert_allclose(alone.box, step.box, atol=1e-2)


@pytest.mark.parametrize("wrapped", [False, True])
def test_official_checkpoint_forms_are_read(tmp_path, alex_state, wrapped):
    state = alex_state
    if wrapped:
        prefixed = {f"module.{key}": value for key, value in alex_state.items()}
        state = {"state_dict": prefixed, "epoch": 20, "optimizer": {"lr": np.float64(0.1)}}
    torch.save(state, tmp_path / "model.pth")
    tracker = nat2024.create_tracker("siamrpnpp", weights=tmp_path / "model.pth")
    assert tracker.variant == "alex"
    assert tracker.weights.origin == "given"
    for key, value in tracker.model.state_dict().items():
        assert torch.equal(value, alex_state[key]), key


def test_a_checkpoint_of_another_network_is_refused(tmp_path, alex_state):
    del alex_state  # only its fixture's cost is shared
    torch.save({"backbone.conv1.weight": torch.zeros(2)}, tmp_path / "model.pth")
    with pytest.raises(WeightsMismatch, match="not a checkpoint of this network"):
        nat2024.create_tracker("siamrpnpp", weights=tmp_path / "model.pth")


@pytest.mark.parametrize(
    ("options", "experiment"),
    [
        ({"variant": "alex"}, "siamrpn_alex_dwxcorr/"),
        ({"variant": "alex_otb"}, "siamrpn_alex_dwxcorr_otb/"),
        ({"variant": "r50"}, "siamrpn_r50_l234_dwxcorr/"),
    ],
)
def test_missing_weights_name_the_official_file_and_how_to_pass_it(options, experiment):
    with pytest.raises(WeightsMissing) as caught:
        nat2024.create_tracker("siamrpnpp", **options)
    message = str(caught.value)
    assert f"{experiment}model.pth" in message
    assert "STVIR/pysot" in message
    assert "--weights siamrpnpp=PATH" in message
    assert message.count("model.pth") == 1


def test_an_unknown_variant_is_an_invalid_option():
    with pytest.raises(InvalidOption, match="no variant 'vgg'"):
        nat2024.create_tracker("siamrpnpp", weights=False, variant="vgg")


def test_the_card_lists_a_file_for_each_variant():
    from nat2024_trackers.siamrpnpp.plugin import SiamRPNpp
    from nat2024_trackers.siamrpnpp.variants import VARIANTS

    card = SiamRPNpp.card
    assert card.parameters == 6_251_102
    assert [file.variant for file in card.weights] == list(VARIANTS)
    assert {file.variant: file.name for file in card.weights if not file.bundled} == {
        name: f"{variant.experiment}/model.pth"
        for name, variant in VARIANTS.items()
        if variant.experiment
    }
    assert [file.variant for file in card.weights if file.bundled] == ["compact"]
