"""What is EnlightenGAN's own for users: its maps, and what attention means there."""

import pytest
import torch


@pytest.fixture(scope="module")
def enhancer(procedural_enhancer):
    return procedural_enhancer("enlightengan")


def test_maps_have_the_size_of_the_image(enhancer, procedural_batch):
    maps = enhancer.maps(procedural_batch("enlightengan.maps", (2, 3, 33, 50)))
    shapes = {name: tuple(value.shape) for name, value in maps.items()}
    assert shapes == {
        "gray": (2, 1, 33, 50),
        "latent": (2, 3, 33, 50),
        "output": (2, 3, 33, 50),
    }


def test_the_attention_map_is_darkness(enhancer):
    batch = torch.zeros(1, 3, 16, 16)
    batch[..., 8:] = 1.0
    attention = enhancer.maps(batch)["gray"]
    assert attention[..., :8].min().item() == pytest.approx(1.0, abs=1e-6)
    assert attention[..., 8:].abs().max().item() == pytest.approx(0.0, abs=1e-6)
