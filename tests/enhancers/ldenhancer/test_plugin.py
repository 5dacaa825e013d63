"""LDEnhancer as users create it: weights, padding, options, and errors that say what to do."""

import numpy as np
import pytest
import torch
import torch.nn.functional as F

from nat2024.errors import ArrayContract, InvalidOption, WeightsMismatch, WeightsMissing
from nat2024.images import batch_to_image, image_to_batch
from nat2024.registry import create_enhancer
from nat2024.testing.enhancers import night_image
from nat2024_enhancers.ldenhancer.model import LDEnhancerNet


@pytest.fixture(scope="module")
def state(procedural_state):
    return procedural_state(LDEnhancerNet())


@pytest.fixture(scope="module")
def weights(state, tmp_path_factory):
    path = tmp_path_factory.mktemp("weights") / "procedural.pth"
    torch.save(state, path)
    return path


@pytest.fixture
def enhancer(weights):
    return create_enhancer("ldenhancer", weights=weights)


def test_it_is_created_in_evaluation_mode_with_the_given_weights(enhancer, state, weights):
    assert not enhancer.model.training
    assert (enhancer.weights.path, enhancer.weights.origin) == (weights, "given")
    assert enhancer.weights.known_as == ""
    for key, value in enhancer.model.state_dict().items():
        assert torch.equal(value, state[key]), key


@pytest.mark.parametrize("size", [(33, 50), (48, 80), (127, 17), (20, 300)])
def test_sides_are_padded_by_reflection_and_cut_back(enhancer, procedural_batch, size):
    batch = procedural_batch("ldenhancer.pad", (1, 3, *size))
    height, width = size
    padded = F.pad(batch, (0, -width % 16, 0, -height % 16), mode="reflect")
    with torch.inference_mode():
        expected = enhancer.model(padded)[0][..., :height, :width].clamp(0, 1)
    actual = enhancer.enhance_batch(batch)
    torch.testing.assert_close(actual, expected, rtol=0, atol=0)


def test_short_sides_are_padded_by_replication(enhancer):
    image = np.full((1, 1, 3), (40, 20, 10), np.uint8)
    whole = enhancer.enhance(np.full((16, 16, 3), (40, 20, 10), np.uint8))
    assert np.array_equal(enhancer.enhance(image), whole[:1, :1])


def test_enhance_feeds_rgb_and_rounds(enhancer):
    image = night_image(40, 56)
    expected = batch_to_image(enhancer.enhance_batch(image_to_batch(image)))
    assert np.array_equal(enhancer.enhance(image), expected)
    bgr = np.ascontiguousarray(image[..., ::-1])
    assert np.array_equal(enhancer.enhance(bgr, bgr=True), expected[..., ::-1])
    assert not np.array_equal(enhancer.enhance(bgr), expected[..., ::-1])


def test_channel_order_rgb_turns_batches_that_come_in_bgr(enhancer, weights, procedural_batch):
    batch = procedural_batch("ldenhancer.order", (1, 3, 32, 48))
    turned = create_enhancer("ldenhancer", weights=weights, channel_order="rgb")
    expected = enhancer.enhance_batch(batch.flip(1)).flip(1)
    assert torch.equal(turned.enhance_batch(batch), expected)
    assert not torch.equal(enhancer.enhance_batch(batch), expected)


def test_clamp_limits_the_raw_output(weights, state):
    bright = {**state, "content_estimation.e_conv5.bias": torch.full((12,), 0.9)}
    batch = torch.full((1, 3, 32, 32), 1.5)
    raw = create_enhancer("ldenhancer", weights=weights, clamp=False)
    limited = create_enhancer("ldenhancer", weights=weights)
    for one in (raw, limited):
        one.model.load_state_dict(bright)
    assert raw.enhance_batch(batch).max() > 1
    assert torch.equal(limited.enhance_batch(batch), raw.enhance_batch(batch).clamp(0, 1))


def test_maps_have_the_padded_size(enhancer, procedural_batch):
    maps = enhancer.maps(procedural_batch("ldenhancer.maps", (2, 3, 33, 50)))
    shapes = {name: tuple(value.shape) for name, value in maps.items()}
    assert shapes == {
        **dict.fromkeys(("F0", "F1", "M"), (2, 8, 3, 4)),
        **dict.fromkeys(("O1", "O2"), (2, 3, 48, 64)),
        **dict.fromkeys(("P_S", "P_E", "A"), (2, 12, 48, 64)),
    }


def test_loading_a_state_dict_takes_effect_at_the_next_call(enhancer, procedural_batch):
    image, batch = night_image(40, 56), procedural_batch("ldenhancer.stale", (1, 3, 40, 56))
    other = create_enhancer("ldenhancer", weights=False)
    before = enhancer.enhance(image)
    assert not torch.equal(enhancer.enhance_batch(batch), other.enhance_batch(batch))
    enhancer.model.load_state_dict(other.model.state_dict())
    assert torch.equal(enhancer.enhance_batch(batch), other.enhance_batch(batch))
    assert torch.equal(enhancer.maps(batch)["A"], other.maps(batch)["A"])
    assert np.array_equal(enhancer.enhance(image), other.enhance(image))
    assert not np.array_equal(enhancer.enhance(image), before)


def test_pad_multiple_8_works_and_fails_where_the_official_code_does(enhancer, weights):
    official = create_enhancer("ldenhancer", weights=weights, pad_multiple=8)
    for size in ((127, 127), (41, 16)):
        image = night_image(*size)
        assert np.array_equal(official.enhance(image), enhancer.enhance(image))
    for size in ((101, 77), (1, 1), (40, 64)):
        with pytest.raises(ArrayContract, match="pad_multiple=16"):
            official.enhance(night_image(*size))
        with pytest.raises(ArrayContract, match="pad_multiple=16"):
            official.maps(image_to_batch(night_image(*size)))


def test_sides_above_8000_are_refused(enhancer):
    with pytest.raises(ArrayContract, match=r"at most 8000 pixels a side.*8016x16"):
        enhancer.enhance(np.zeros((3, 8001, 3), np.uint8))


def test_iteration_options_reach_the_network(weights, procedural_batch):
    batch = procedural_batch("ldenhancer.options", (1, 3, 32, 32))
    paper = create_enhancer("ldenhancer", weights=weights, iteration_sign="paper")
    code = create_enhancer("ldenhancer", weights=weights)
    assert not torch.equal(paper.enhance_batch(batch), code.enhance_batch(batch))
    two = create_enhancer("ldenhancer", weights=False, iterations=2)
    assert two.maps(batch)["P_E"].shape[1] == 6
    with pytest.raises(WeightsMismatch, match=r"e_conv5.weight is \(12, 32, 3, 3\), expected \(6"):
        create_enhancer("ldenhancer", weights=weights, iterations=2)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"pad_multiple": 12}, "pad_multiple"),
        ({"iteration_sign": "both"}, "iteration_sign"),
        ({"iterations": 0}, "iterations must be at least 1"),
        ({"iteration": 4}, "no option 'iteration'; closest: iterations"),
    ],
)
def test_wrong_options_are_refused(options, message):
    with pytest.raises(InvalidOption, match=message):
        create_enhancer("ldenhancer", weights=False, **options)


def test_missing_weights_are_named(tmp_path):
    with pytest.raises(WeightsMissing, match="no such file"):
        create_enhancer("ldenhancer", weights=tmp_path / "absent.pth")


def test_weights_of_another_network_are_refused(tmp_path, state):
    path = tmp_path / "other.pth"
    torch.save({"e_conv1.weight": torch.zeros(3)}, path)
    with pytest.raises(WeightsMismatch, match="not a checkpoint of this network"):
        create_enhancer("ldenhancer", weights=path)
    torch.save({key: value for key, value in state.items() if key != "decompose.bias"}, path)
    with pytest.raises(WeightsMismatch, match=r"1 of 120 entries are missing \(decompose.bias\)"):
        create_enhancer("ldenhancer", weights=path)


def test_card_counts_the_parameters():
    enhancer = create_enhancer("ldenhancer", weights=False)
    assert enhancer.card.parameters == sum(p.numel() for p in enhancer.model.parameters())
    assert enhancer.card.needs_weights
    files = enhancer.card.weights
    assert {file.licence for file in files if not file.bundled} == {"none stated"}
