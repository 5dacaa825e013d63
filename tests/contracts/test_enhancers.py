"""Every enhancer that is installed keeps the contract; later ones are found by themselves."""

import numpy as np
import pytest
import torch

from nat2024.cards import Card
from nat2024.interfaces import NeuralEnhancer
from nat2024.registry import create_enhancer, list_enhancers, load_plugin
from nat2024.testing import check_enhancer
from nat2024.testing.enhancers import night_image

NEURAL = [
    name for name in list_enhancers() if issubclass(load_plugin(name, "enhancer"), NeuralEnhancer)
]


def test_there_are_enhancers_to_check():
    assert {"none", "gamma", "clahe", "ldenhancer"} <= set(list_enhancers())


@pytest.mark.parametrize("name", list_enhancers())
def test_installed_enhancer_keeps_the_contract(name):
    torch.manual_seed(0)
    enhancer = create_enhancer(name, weights=False)
    check_enhancer(enhancer)
    assert enhancer.name == name
    assert isinstance(enhancer.card, Card)


@pytest.mark.parametrize("name", NEURAL)
def test_batches_are_turned_for_networks_that_shall_see_rgb(name):
    enhancer = create_enhancer(name, weights=False)
    turning = create_enhancer(name, weights=False, channel_order="rgb")
    turning.model.load_state_dict(enhancer.model.state_dict())
    batch = torch.rand(1, 3, 20, 27)
    assert torch.equal(turning.enhance_batch(batch), enhancer.enhance_batch(batch.flip(1)).flip(1))
    image = night_image(20, 27)
    assert np.array_equal(turning.enhance(image), enhancer.enhance(image))


@pytest.mark.parametrize("name", NEURAL)
def test_autocast_of_the_caller_changes_nothing(name):
    enhancer = create_enhancer(name, weights=False)
    batch = torch.rand(1, 3, 24, 24)
    expected = enhancer.enhance_batch(batch)
    with torch.autocast("cpu", dtype=torch.bfloat16):
        assert torch.equal(enhancer.enhance_batch(batch), expected)
