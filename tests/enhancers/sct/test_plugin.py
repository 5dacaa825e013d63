"""What is SCT's own for users: its maps, and the statistics of its norms."""

import pytest
import torch

from nat2024.errors import InvalidOption
from nat2024.registry import create_enhancer


@pytest.fixture(scope="module")
def enhancer(procedural_enhancer):
    return procedural_enhancer("sct")


def test_maps_have_their_sizes(enhancer, procedural_batch):
    maps = enhancer.maps(procedural_batch("sct.maps", (2, 3, 33, 50)))
    shapes = {name: tuple(value.shape) for name, value in maps.items()}
    assert shapes == {
        "conv10_full_128": (2, 6, 128, 128),
        "x_r": (2, 3, 33, 50),
        "x_n": (2, 3, 33, 50),
    }


def test_statistics_of_each_image_reach_the_network(
    enhancer, procedural_enhancer, procedural_batch
):
    batch = procedural_batch("sct.statistics", (2, 3, 30, 40))
    by_image = procedural_enhancer("sct", statistics="image")
    answer = by_image.enhance_batch(batch)
    assert not torch.allclose(answer, enhancer.enhance_batch(batch))
    apart = torch.cat([by_image.enhance_batch(one[None]) for one in batch])
    torch.testing.assert_close(answer, apart, rtol=0, atol=1e-5)
    with pytest.raises(InvalidOption, match="statistics"):
        create_enhancer("sct", weights=False, statistics="batch")
