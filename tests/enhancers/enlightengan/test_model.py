"""What is EnlightenGAN's own: wide images are halved, batch statistics are of whole images."""

import copy

import pytest
import torch
import torch.nn.functional as F

from nat2024.networks import bands
from nat2024_enhancers.enlightengan import model
from nat2024_enhancers.enlightengan.model import EnlightenGANNet


@pytest.fixture
def network(procedural_network):
    return procedural_network(EnlightenGANNet())


def test_wide_images_are_halved_and_enlarged_again(network, procedural_batch, monkeypatch):
    wide = procedural_batch("enlightengan.wide", (1, 3, 20, 48))
    whole = network(wide)
    monkeypatch.setattr(model, "WIDEST", 47)
    with torch.no_grad():
        halved = network(wide)
        maps = network.maps(wide)
        monkeypatch.setattr(model, "WIDEST", 2200)
        small = network(F.avg_pool2d(wide, 2))
    expected = F.interpolate(small, scale_factor=2, mode="bilinear")
    torch.testing.assert_close(halved, expected, rtol=0, atol=2e-6)
    assert not torch.allclose(halved, whole)
    assert maps["latent"].shape == (1, 3, 10, 24)


@pytest.mark.parametrize("size", [(1, 49), (33, 51), (20, 49)])
def test_wide_images_with_odd_sides_keep_their_size(network, procedural_batch, monkeypatch, size):
    wide = procedural_batch("enlightengan.odd", (1, 3, *size))
    even = F.pad(wide, (0, size[1] % 2, 0, size[0] % 2), mode="replicate")
    monkeypatch.setattr(model, "WIDEST", 47)
    with torch.no_grad():
        expected = network(even)[..., : size[0], : size[1]]
        torch.testing.assert_close(network(wide), expected, rtol=0, atol=2e-6)


def test_padding_is_split_and_may_pass_the_widest(network, procedural_batch, monkeypatch):
    image = procedural_batch("enlightengan.split", (1, 3, 20, 41))
    padded = F.pad(image, (3, 4, 6, 6), mode="reflect")
    monkeypatch.setattr(model, "WIDEST", 45)
    with torch.no_grad():
        actual = network(image)
        monkeypatch.setattr(model, "WIDEST", 2200)
        expected = network(padded)[..., 6:26, 3:44]
    torch.testing.assert_close(actual, expected, rtol=0, atol=2e-6)


@pytest.mark.parametrize("grad", [True, False])
def test_batch_statistics_are_those_of_the_whole_image(
    network, procedural_batch, monkeypatch, grad
):
    tall = procedural_batch("enlightengan.statistics", (2, 3, 64, 32))
    network.train()
    single = copy.deepcopy(network).double()
    monkeypatch.setattr(bands, "BAND_PIXELS", 1)
    with torch.set_grad_enabled(grad):
        answer = network(tall.contiguous(memory_format=torch.channels_last))
        exact = single(tall.double())
    assert network.bn9_1.num_batches_tracked == 1
    torch.testing.assert_close(answer.double(), exact, rtol=0, atol=1e-5)
