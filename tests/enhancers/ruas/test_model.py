"""The network: official names and shapes, numbers, bands of rows, and training."""

import copy
import json
from pathlib import Path

import pytest
import torch
import torch.nn.functional as F

from nat2024.networks import bands
from nat2024_enhancers.ruas.model import RUASNet, largest_of_four

GOLDEN = json.loads(
    (Path(__file__).parents[2] / "data" / "ruas_golden.json").read_text(encoding="utf-8")
)


@pytest.fixture(scope="module")
def state(procedural_state):
    return procedural_state(RUASNet())


@pytest.fixture
def network(state):
    net = RUASNet().eval()
    net.load_state_dict(state)
    return net


@pytest.fixture(scope="module")
def batch(procedural_batch):
    return procedural_batch("ruas.input", (2, 3, 37, 53))


def test_state_dict_has_the_official_names_and_shapes():
    net = RUASNet()
    assert {k: list(v.shape) for k, v in net.state_dict().items()} == GOLDEN["state_dict"]
    assert sum(p.numel() for p in net.parameters()) == 3_438


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
    tall = procedural_batch("ruas.tall", (2, 3, 67, 33))
    with torch.no_grad():
        whole = network(tall)
        monkeypatch.setattr(bands, "BAND_PIXELS", 2 * 33 * 6)
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
        fresh = RUASNet().eval()
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
    (network(batch).square().mean() + network.maps(batch)["denoised"].square().mean()).backward()
    without = [name for name, p in network.named_parameters() if p.grad is None]
    assert not without
    assert all(p.grad.isfinite().all() for p in network.parameters())


def test_a_few_steps_lower_the_loss(batch):
    torch.manual_seed(4)
    net = RUASNet(denoise=True).train()
    optimiser = torch.optim.Adam(net.parameters(), lr=1e-2)
    losses = []
    for _ in range(3):
        loss = F.mse_loss(net(batch[:1, :, :32, :32]), torch.full((1, 3, 32, 32), 0.6))
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        losses.append(loss.item())
    assert losses[-1] < losses[0]


def test_the_denoised_image_comes_in_bands_as_well(state, procedural_batch, monkeypatch):
    # weights of a fifth, since procedural ones make the noise many times the image
    net = RUASNet(denoise=True).eval()
    net.load_state_dict({key: value / 5 for key, value in state.items()})
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


def test_illumination_is_at_least_a_thousandth(state):
    net = RUASNet().eval()
    net.load_state_dict(state)
    with torch.no_grad():
        for stage in net.enhance_net.iems:
            stage.cell.c5.bias.fill_(-50.0)
        maps = net.maps(torch.full((1, 3, 8, 8), 0.0005))
    assert [maps[f"t{n}"].min().item() for n in (1, 2, 3)] == pytest.approx([0.001] * 3)
    assert maps["u3"].max().item() == pytest.approx(0.5)
