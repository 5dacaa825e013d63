"""The network: official names and shapes, numbers, bands of rows, and training."""

import copy
import json
from pathlib import Path

import pytest
import torch
import torch.nn.functional as F

from nat2024.networks import bands
from nat2024_enhancers.enlightengan import model
from nat2024_enhancers.enlightengan.model import EnlightenGANNet

GOLDEN = json.loads(
    (Path(__file__).parents[2] / "data" / "enlightengan_golden.json").read_text(encoding="utf-8")
)


@pytest.fixture(scope="module")
def state(procedural_state):
    return procedural_state(EnlightenGANNet())


@pytest.fixture
def network(state):
    net = EnlightenGANNet().eval()
    net.load_state_dict(state)
    return net


@pytest.fixture(scope="module")
def batch(procedural_batch):
    return procedural_batch("enlightengan.input", (2, 3, 37, 53))


def test_state_dict_has_the_official_names_and_shapes():
    net = EnlightenGANNet()
    assert {k: list(v.shape) for k, v in net.state_dict().items()} == GOLDEN["state_dict"]
    assert sum(p.numel() for p in net.parameters()) == 8_636_675


def test_procedural_weights_give_the_stored_numbers(network, batch, describe):
    with torch.no_grad():
        arrays = {"enhanced": network(batch), **network.maps(batch)}
    assert arrays.keys() == GOLDEN["maps"].keys()
    for name, array in arrays.items():
        actual, expected = describe(array), GOLDEN["maps"][name]
        assert actual["shape"] == expected["shape"]
        for key in ("mean", "std", "samples"):
            assert actual[key] == pytest.approx(expected[key], abs=1e-5, rel=1e-5), (name, key)


def test_bands_of_rows_equal_the_whole_image(network, procedural_batch, monkeypatch):
    tall = procedural_batch("enlightengan.tall", (2, 3, 67, 33))
    with torch.no_grad():
        whole = network(tall)
        monkeypatch.setattr(bands, "BAND_PIXELS", 2 * 33 * 8)
        banded = network(tall)
    torch.testing.assert_close(banded, whole, rtol=0, atol=2e-6)


def test_inference_and_gradient_forms_agree(network, batch):
    with torch.no_grad():
        inferred = network(batch)
    torch.testing.assert_close(network(batch).detach(), inferred, rtol=1e-5, atol=2e-6)


def test_a_copy_follows_its_own_weights(network, batch, state):
    with torch.no_grad():
        before = network(batch)
        other = copy.deepcopy(network)
        other.load_state_dict(
            {k: v * 0.9 if v.is_floating_point() else v for k, v in state.items()}
        )
        assert not torch.equal(other(batch), before)
        fresh = EnlightenGANNet().eval()
        fresh.load_state_dict(other.state_dict())
        assert torch.equal(other(batch), fresh(batch))
        assert torch.equal(network(batch), before)


def test_input_is_not_modified(network, batch):
    given = batch.clone()
    with torch.no_grad():
        network(given)
    assert torch.equal(given, batch)


def test_gradient_reaches_every_parameter(network, batch):
    network.train()
    network(batch).square().mean().backward()
    without = [name for name, p in network.named_parameters() if p.grad is None]
    assert not without
    assert all(p.grad.isfinite().all() for p in network.parameters())


def test_a_few_steps_lower_the_loss(batch):
    torch.manual_seed(4)
    net = EnlightenGANNet().train()
    optimiser = torch.optim.Adam(net.parameters(), lr=1e-3)
    losses = []
    for _ in range(3):
        loss = F.mse_loss(net(batch[:1, :, :32, :32]), torch.full((1, 3, 32, 32), 0.6))
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        losses.append(loss.item())
    assert losses[-1] < losses[0]


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
