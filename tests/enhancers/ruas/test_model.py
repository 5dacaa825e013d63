"""What is RUAS's own: the denoised image, the largest of four, and a floor of illumination."""

import pytest
import torch

from nat2024.networks import bands
from nat2024_enhancers.ruas.model import RUASNet, largest_of_four


def test_the_denoised_image_comes_in_bands_as_well(procedural_state, procedural_batch, monkeypatch):
    # weights of a fifth, since procedural ones make the noise many times the image
    net = RUASNet(denoise=True).eval()
    net.load_state_dict({key: value / 5 for key, value in procedural_state(net).items()})
    tall = procedural_batch("ruas.tall", (2, 3, 67, 33))
    with torch.no_grad():
        whole = net(tall)
        torch.testing.assert_close(whole, net.maps(tall)["denoised"], rtol=0, atol=1e-6)
        monkeypatch.setattr(bands, "BAND_PIXELS", 2 * 33 * 6)
        torch.testing.assert_close(net(tall), whole, rtol=0, atol=2e-6)


def test_the_largest_of_four_looks_right_and_down():
    image = torch.tensor([[[[0.1, 0.5, 0.2], [0.3, 0.0, 0.9]]]])
    expected = torch.tensor([[[[0.5, 0.9, 0.9], [0.3, 0.9, 0.9]]]])
    assert torch.equal(largest_of_four(image), expected)
    negative = largest_of_four(-image - 1)
    # outside the image there are zeros
    assert torch.equal(negative[..., 1, :], torch.zeros(1, 1, 3))
    assert torch.equal(negative[..., 0, :], torch.tensor([[[-1.0, -1.0, 0.0]]]))


def test_illumination_is_at_least_a_thousandth(procedural_network):
    net = procedural_network(RUASNet())
    with torch.no_grad():
        for stage in net.enhance_net.iems:
            stage.cell.c5.bias.fill_(-50.0)
        maps = net.maps(torch.full((1, 3, 8, 8), 0.0005))
    assert [maps[f"t{n}"].min().item() for n in (1, 2, 3)] == pytest.approx([0.001] * 3)
    assert maps["u3"].max().item() == pytest.approx(0.5)
