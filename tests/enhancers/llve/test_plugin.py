"""What is LLVE's own for users: how short sides are filled up, and that there are no maps."""

import pytest
import torch


@pytest.fixture(scope="module")
def enhancer(procedural_enhancer):
    return procedural_enhancer("llve")


def test_short_sides_are_filled_up_by_replication(enhancer, procedural_batch):
    batch = procedural_batch("llve.short", (1, 3, 5, 21))
    filled = torch.cat([batch, batch[..., -1:, :].expand(-1, -1, 11, -1)], dim=-2)
    answer = enhancer.enhance_batch(batch)
    assert torch.equal(answer, enhancer.enhance_batch(filled)[..., :5, :])


def test_there_are_no_maps(enhancer):
    assert enhancer.maps(torch.zeros(1, 3, 20, 20)) == {}
