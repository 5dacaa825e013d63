"""What users can rely on with SCT, EnlightenGAN, LLVE and RUAS alike: weights, sizes, options."""

import numpy as np
import pytest
import torch

from nat2024.errors import ArrayContract, InvalidOption, WeightsMismatch, WeightsMissing
from nat2024.images import batch_to_image, image_to_batch
from nat2024.registry import create_enhancer
from nat2024.testing.enhancers import night_image


def test_it_is_created_in_evaluation_mode_with_the_given_weights(enhancer, state):
    assert not enhancer.model.training
    assert enhancer.weights.origin == "given"
    for key, value in enhancer.model.state_dict().items():
        assert torch.equal(value, state[key]), key


@pytest.mark.parametrize("size", [(1, 1), (2, 9), (15, 31), (3, 5000), (200, 2)])
def test_all_sizes_are_taken(enhancer, size):
    answer = enhancer.enhance(night_image(*size))
    assert answer.shape == (*size, 3)


def test_black_and_broken_images_are_answered(enhancer):
    assert enhancer.enhance(np.zeros((20, 30, 3), np.uint8)).shape == (20, 30, 3)
    batch = torch.full((2, 3, 20, 30), torch.nan)
    assert enhancer.enhance_batch(batch).shape == batch.shape
    assert batch_to_image(enhancer.enhance_batch(batch)[:1]).dtype == np.uint8


def test_images_are_fed_in_their_order_and_rounded_or_cut(row, enhancer, weights):
    image = night_image(40, 56)
    given = row.order(image)
    answer = enhancer.enhance_batch(image_to_batch(given))
    assert np.array_equal(enhancer.enhance(image), row.order(batch_to_image(answer)))
    cutting = create_enhancer(row.name, weights=weights, quantise="truncate")
    cut = row.order(batch_to_image(answer, quantise="truncate"))
    assert np.array_equal(cutting.enhance(image), cut)
    assert not np.array_equal(enhancer.enhance(image), cut)


def test_channel_order_rgb_turns_batches_that_come_in_bgr(row, enhancer, weights, procedural_batch):
    batch = procedural_batch(f"{row.name}.order", (1, 3, 32, 48))
    turned = create_enhancer(row.name, weights=weights, channel_order="rgb")
    expected = enhancer.enhance_batch(batch.flip(1)).flip(1)
    assert torch.equal(turned.enhance_batch(batch), expected)
    assert not torch.equal(enhancer.enhance_batch(batch), expected)


def test_clamp_limits_the_raw_output(row, enhancer, weights, procedural_batch):
    batch = procedural_batch(f"{row.name}.clamp", (1, 3, 32, 32))
    raw = create_enhancer(row.name, weights=weights, clamp=False, **row.unbounded).enhance_batch(
        batch
    )
    assert raw.min() < 0
    limited = create_enhancer(row.name, weights=weights, **row.unbounded).enhance_batch(batch)
    assert torch.equal(limited, raw.clamp(0, 1))
    assert not limited.requires_grad
    assert not limited.is_inference()


def test_loading_a_state_dict_takes_effect_at_the_next_call(row, weights, procedural_batch):
    enhancer = create_enhancer(row.name, weights=weights)
    batch = procedural_batch(f"{row.name}.stale", (1, 3, 40, 56))
    other = create_enhancer(row.name, weights=False)
    assert not torch.equal(enhancer.enhance_batch(batch), other.enhance_batch(batch))
    enhancer.model.load_state_dict(other.model.state_dict())
    assert torch.equal(enhancer.enhance_batch(batch), other.enhance_batch(batch))


def test_what_is_no_image_or_batch_is_refused(enhancer):
    with pytest.raises(ArrayContract):
        enhancer.maps(torch.zeros(3, 20, 20))
    with pytest.raises(ArrayContract):
        enhancer.enhance(np.zeros((20, 20), np.uint8))


def test_weights_that_are_missing_or_of_another_network_are_refused(row, tmp_path, state):
    with pytest.raises(WeightsMissing, match=row.official):
        create_enhancer(row.name)
    with pytest.raises(WeightsMissing, match="no such file"):
        create_enhancer(row.name, weights=tmp_path / "absent.pth")
    path = tmp_path / "other.pth"
    lacking = dict(list(state.items())[1:])
    torch.save(lacking, path)
    with pytest.raises(WeightsMismatch, match=rf"1 of {len(state)} entries are missing"):
        create_enhancer(row.name, weights=path)


def test_unknown_options_are_refused(row):
    with pytest.raises(InvalidOption, match="no option"):
        create_enhancer(row.name, weights=False, clmp=True)
    with pytest.raises(InvalidOption, match="quantise"):
        create_enhancer(row.name, weights=False, quantise="floor")
