"""Bands of rows give what the whole image gives."""

import pytest
import torch
from torch import nn

from nat2024.networks import bands
from nat2024.networks.bands import bands_of, run_in_bands


@pytest.mark.parametrize("stride", [1, 4])
def test_bands_equal_the_whole_image(monkeypatch, stride):
    torch.manual_seed(0)
    network = nn.Sequential(nn.Conv2d(3, 4, 3, padding=1), nn.Conv2d(4, 3, 3, padding=1))
    image = torch.rand(2, 3, 37, 11)
    with torch.no_grad():
        whole = run_in_bands(network, image, halo=4, stride=stride)
        monkeypatch.setattr(bands, "BAND_PIXELS", 1)
        pieces = list(bands_of(2, 37, 11, stride=stride))
        cut = run_in_bands(network, image, halo=4, stride=stride)
    assert len(pieces) == -(-37 // stride)
    torch.testing.assert_close(cut, whole, rtol=0, atol=1e-6)


def test_training_sees_one_band(monkeypatch):
    monkeypatch.setattr(bands, "BAND_PIXELS", 1)
    assert list(bands_of(1, 40, 40)) == [(0, 40)]
    with torch.no_grad():
        assert len(list(bands_of(1, 40, 40))) == 40


def test_the_size_of_bands_can_be_chosen():
    with torch.no_grad():
        assert list(bands_of(1, 9, 10, pixels=40)) == [(0, 4), (4, 8), (8, 9)]
        assert list(bands_of(2, 9, 10, pixels=40)) == [(0, 2), (2, 4), (4, 6), (6, 8), (8, 9)]
