"""The networks: numbers, folded layers, bands, and training."""

import json
from pathlib import Path

import pytest
import torch

from nat2024.errors import ArrayContract
from nat2024_enhancers.kindpp import model
from nat2024_enhancers.kindpp.model import KindPlusPlusNet, Restoration, Scale, normalise

GOLDEN = json.loads(
    (Path(__file__).parents[2] / "data" / "kindpp_golden.json").read_text(encoding="utf-8")
)


@pytest.fixture(scope="module")
def network(state):
    net = KindPlusPlusNet().eval()
    net.load_state_dict({**net.state_dict(), **state})
    return net


def test_procedural_weights_give_the_stored_numbers(network, procedural_batch, describe):
    batch = normalise(procedural_batch("kindpp.input", (2, 3, 16, 24)))
    with torch.no_grad():
        arrays = {"enhanced": network(batch), "adjusted": network(batch, 5.0)}
        arrays |= network.maps(batch, 5.0)
    assert arrays.keys() == GOLDEN.keys()
    for name, array in arrays.items():
        actual, expected = describe(array), GOLDEN[name]
        assert actual["shape"] == expected["shape"]
        for key in ("mean", "std", "samples"):
            assert actual[key] == pytest.approx(expected[key], abs=1e-5), (name, key)


@pytest.mark.parametrize("pooling", [1, 2, 4])
def test_folded_batch_norm_equals_the_layer_whatever_its_signs(pooling):
    torch.manual_seed(pooling)
    scale = Scale(8, pooling).eval()
    norm = scale.batch_normalization
    for values in (norm.weight, norm.bias, norm.running_mean):
        values.data = torch.randn(8)
    x = torch.randn(2, 8, 12, 16)
    expected = scale(x).detach()  # with gradients, nothing is folded
    with torch.no_grad():
        torch.testing.assert_close(scale(x), expected, rtol=0, atol=1e-5)


@pytest.mark.parametrize("part", ["DecomNet", "Denoise_Net"])
def test_bands_equal_the_whole_image(network, procedural_batch, monkeypatch, part):
    channels = 3 if part == "DecomNet" else 4
    halo = model._DECOMPOSITION_HALO if part == "DecomNet" else model._HALO
    image = procedural_batch("kindpp.bands", (1, channels, 72, 4))
    with torch.no_grad():
        whole = network.get_submodule(part)(image)
        monkeypatch.setattr(model, "_BAND_PIXELS", 8 * 4)
        banded = model._in_bands(network.get_submodule(part), image, halo)
        torch.testing.assert_close(banded, whole, rtol=0, atol=1e-6)


def test_halo_is_as_far_as_the_restoration_sees():
    torch.manual_seed(0)
    net = Restoration()
    with torch.no_grad():
        image = torch.rand(1, 4, 64, 4)
        image.requires_grad_()
    with torch.enable_grad():
        for row in (32, 35):
            (slope,) = torch.autograd.grad(net.eval()(image)[..., row, :].sum(), image)
            seen = slope.abs().sum((0, 1, 3)).nonzero().flatten()
            assert seen.min() >= 32 - model._HALO
            assert seen.max() <= 35 + model._HALO


def test_gradients_reach_all_weights():
    net = KindPlusPlusNet().train()
    net(torch.rand(2, 3, 8, 8), 5.0).mean().backward()
    missing = [name for name, value in net.named_parameters() if value.grad is None]
    assert not missing


def test_other_sides_are_refused(network):
    with pytest.raises(ArrayContract, match="multiples of 4, not 10x8"):
        network(torch.rand(1, 3, 8, 10))


def test_each_image_of_a_batch_is_stretched_by_itself():
    batch = torch.rand(3, 3, 4, 4) * torch.tensor([0.1, 0.5, 1.0]).view(3, 1, 1, 1) + 0.1
    stretched = normalise(batch)
    assert torch.equal(stretched.amin((1, 2, 3)), torch.zeros(3))
    torch.testing.assert_close(stretched.amax((1, 2, 3)), torch.ones(3))
    assert torch.equal(normalise(torch.full((1, 3, 2, 2), 0.5)), torch.zeros(1, 3, 2, 2))
