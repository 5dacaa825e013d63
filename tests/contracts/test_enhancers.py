"""Every enhancer that is installed keeps the contract; later ones are found by themselves."""

import pytest
import torch

from nat2024.cards import Card
from nat2024.registry import create_enhancer, list_enhancers
from nat2024.testing import check_enhancer


def test_there_are_enhancers_to_check():
    assert {"none", "gamma", "clahe", "ldenhancer"} <= set(list_enhancers())


@pytest.mark.parametrize("name", list_enhancers())
def test_installed_enhancer_keeps_the_contract(name):
    torch.manual_seed(0)
    enhancer = create_enhancer(name, weights=False)
    check_enhancer(enhancer)
    assert enhancer.name == name
    assert isinstance(enhancer.card, Card)


@pytest.mark.parametrize("name", list_enhancers())
def test_order_of_channels_is_kept_with_every_option(name):
    torch.manual_seed(0)
    enhancer = create_enhancer(name, weights=False)
    if hasattr(enhancer, "channel_order"):
        check_enhancer(create_enhancer(name, weights=False, channel_order="rgb"))
