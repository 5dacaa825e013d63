"""LLVE as users create it: weights, sizes, options, and errors that say what to do."""

import pytest
import torch

from nat2024.registry import create_enhancer
from nat2024_enhancers.llve.model import LLVENet


@pytest.fixture(scope="module")
def state(procedural_state):
    return procedural_state(LLVENet())


@pytest.fixture(scope="module")
def weights(state, tmp_path_factory):
    path = tmp_path_factory.mktemp("weights") / "procedural.pth"
    torch.save(state, path)
    return path


@pytest.fixture(scope="module")
def enhancer(weights):
    return create_enhancer("llve", weights=weights)


def test_short_sides_are_filled_up_by_replication(enhancer, procedural_batch):
    batch = procedural_batch("llve.short", (1, 3, 5, 21))
    filled = torch.cat([batch, batch[..., -1:, :].expand(-1, -1, 11, -1)], dim=-2)
    answer = enhancer.enhance_batch(batch)
    assert torch.equal(answer, enhancer.enhance_batch(filled)[..., :5, :])


def test_there_are_no_maps(enhancer):
    assert enhancer.maps(torch.zeros(1, 3, 20, 20)) == {}
