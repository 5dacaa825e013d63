"""What DCE++, DarkLighter and HighlightNet have in common: stored numbers, options, odd input."""

import json
from pathlib import Path

import numpy as np
import pytest
import torch

from nat2024.errors import WeightsMismatch, WeightsMissing
from nat2024.images import batch_to_image, image_to_batch
from nat2024.registry import create_enhancer
from nat2024.testing.enhancers import night_image

DATA = Path(__file__).parents[1] / "data"
MAPS = {"dcepp": {"x_r"}, "darklighter": {"r", "n"}, "highlightnet": {"r", "level", "t"}}


@pytest.fixture(params=MAPS)
def name(request):
    return request.param


@pytest.fixture
def enhancer(name, procedural_enhancer):
    return procedural_enhancer(name)


def test_procedural_weights_give_the_stored_numbers(name, enhancer, procedural_batch, describe):
    golden = json.loads((DATA / f"{name}_golden.json").read_text(encoding="utf-8"))["maps"]
    enhancer.clamp = False
    batch = procedural_batch(f"{name}.input", (2, 3, 47, 80))
    arrays = {"enhanced": enhancer.enhance_batch(batch), **enhancer.maps(batch)}
    assert arrays.keys() == golden.keys()
    for key, expected in golden.items():
        actual = describe(arrays[key])
        assert actual["shape"] == expected["shape"], key
        for number in ("mean", "std", "samples"):
            assert actual[number] == pytest.approx(expected[number], abs=1e-5), (key, number)


def test_maps_have_their_published_names(name, enhancer, procedural_batch):
    maps = enhancer.maps(procedural_batch("curves.maps", (2, 3, 13, 14)))
    assert maps.keys() == MAPS[name]
    assert {len(value) for value in maps.values()} == {2}


@pytest.mark.parametrize("size", [(1, 1), (3, 5000), (5000, 3), (2, 11)])
def test_odd_sizes_are_enhanced(enhancer, size):
    image = night_image(*size)
    answer = enhancer.enhance(image)
    assert answer.shape == image.shape
    assert answer.any()
    assert enhancer.maps(image_to_batch(image))


@pytest.mark.parametrize("size", [(1, 1), (40, 56)])
def test_black_stays_finite(name, enhancer, size):
    black = torch.zeros(1, 3, *size)
    enhancer.clamp = False
    answer = enhancer.enhance_batch(black)
    assert answer.isfinite().all()
    if name != "darklighter":  # which takes away what it holds for noise, also below 0
        assert not answer.any()


def test_nan_does_no_harm_beyond_nan(enhancer, procedural_batch):
    batch = procedural_batch("curves.nan", (2, 3, 24, 36))
    clean = enhancer.enhance_batch(batch)
    batch[0, :, 5, 7] = torch.nan
    answer = enhancer.enhance_batch(batch)
    assert answer[0].isnan().any()
    torch.testing.assert_close(answer[1], clean[1], rtol=0, atol=1e-6)
    assert enhancer.maps(batch)
    assert batch_to_image(answer[:1]).shape == (24, 36, 3)


def test_answers_are_limited_unless_asked_otherwise(enhancer, procedural_enhancer):
    bright = torch.tensor([1.5, 0.2, 0.1])[None, :, None, None].expand(1, 3, 24, 24)
    raw = procedural_enhancer(enhancer.name, clamp=False)
    assert raw.enhance_batch(bright).max() > 1
    assert torch.equal(enhancer.enhance_batch(bright), raw.enhance_batch(bright).clamp(0, 1))


def test_channel_order_rgb_turns_batches_that_come_in_bgr(
    enhancer, procedural_enhancer, procedural_batch
):
    batch = procedural_batch("curves.order", (1, 3, 24, 36))
    turned = procedural_enhancer(enhancer.name, channel_order="rgb")
    expected = enhancer.enhance_batch(batch.flip(1)).flip(1)
    assert torch.equal(turned.enhance_batch(batch), expected)


def test_images_are_fed_as_rgb_and_rounded(enhancer, procedural_enhancer):
    image = night_image(25, 38)
    expected = batch_to_image(enhancer.enhance_batch(image_to_batch(image)))
    assert np.array_equal(enhancer.enhance(image), expected)
    cut = procedural_enhancer(enhancer.name, quantise="truncate")
    difference = expected.astype(int) - cut.enhance(image)
    assert set(np.unique(difference)) == {0, 1}


def test_loading_a_state_dict_takes_effect_at_the_next_call(enhancer, procedural_batch):
    batch = procedural_batch("curves.stale", (1, 3, 24, 36))
    torch.manual_seed(0)
    other = create_enhancer(enhancer.name, weights=False)
    before = enhancer.enhance_batch(batch)
    assert not torch.equal(before, other.enhance_batch(batch))
    enhancer.model.load_state_dict(other.model.state_dict())
    assert torch.equal(enhancer.enhance_batch(batch), other.enhance_batch(batch))
    with torch.no_grad():
        enhancer.model.e_conv1.get_parameter(
            next(key for key, _ in enhancer.model.e_conv1.named_parameters())
        ).mul_(3)
    assert not torch.equal(enhancer.enhance_batch(batch), other.enhance_batch(batch))


def test_answers_may_enter_a_training(enhancer, procedural_batch):
    answer = enhancer.enhance_batch(procedural_batch("curves.train", (1, 3, 24, 24)))
    layer = torch.nn.Conv2d(3, 1, 3)
    layer(answer).sum().backward()
    assert layer.weight.grad.isfinite().all()


@pytest.mark.parametrize("name", ["darklighter", "highlightnet"])
def test_weights_are_asked_for(name):
    with pytest.raises(WeightsMissing, match=r"Epoch\d+.pth from github.com"):
        create_enhancer(name)


def test_weights_of_another_are_refused(name, tmp_path):
    path = tmp_path / "other.pth"
    torch.save({"other.weight": torch.zeros(3)}, path)
    with pytest.raises(WeightsMismatch, match="not a checkpoint of this network"):
        create_enhancer(name, weights=path)
