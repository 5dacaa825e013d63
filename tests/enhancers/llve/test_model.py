"""The network: official names and shapes, numbers, bands of rows, and training."""

import copy
import json
from pathlib import Path

import pytest
import torch
import torch.nn.functional as F

from nat2024.networks import bands
from nat2024_enhancers.llve.model import LLVENet, doubled_rows

GOLDEN = json.loads(
    (Path(__file__).parents[2] / "data" / "llve_golden.json").read_text(encoding="utf-8")
)


@pytest.fixture(scope="module")
def state(procedural_state):
    return procedural_state(LLVENet())


@pytest.fixture
def network(state):
    net = LLVENet().eval()
    net.load_state_dict(state)
    return net


@pytest.fixture(scope="module")
def batch(procedural_batch):
    return procedural_batch("llve.input", (2, 3, 37, 53))


def test_state_dict_has_the_official_names_and_shapes():
    net = LLVENet()
    assert {k: list(v.shape) for k, v in net.state_dict().items()} == GOLDEN["state_dict"]
    assert sum(p.numel() for p in net.parameters()) == 4_316_259


def test_procedural_weights_give_the_stored_numbers(network, batch, describe):
    with torch.no_grad():
        arrays = {"enhanced": network(batch)}
    assert arrays.keys() == GOLDEN["maps"].keys()
    for name, array in arrays.items():
        actual, expected = describe(array), GOLDEN["maps"][name]
        assert actual["shape"] == expected["shape"]
        for key in ("mean", "std", "samples"):
            assert actual[key] == pytest.approx(expected[key], abs=1e-5, rel=1e-5), (name, key)


def test_bands_of_rows_equal_the_whole_image(network, procedural_batch, monkeypatch):
    tall = procedural_batch("llve.tall", (2, 3, 67, 33))
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
        fresh = LLVENet().eval()
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
    net = LLVENet().train()
    optimiser = torch.optim.Adam(net.parameters(), lr=1e-3)
    losses = []
    for _ in range(3):
        loss = F.mse_loss(net(batch[:1, :, :32, :32]), torch.full((1, 3, 32, 32), 0.6))
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        losses.append(loss.item())
    assert losses[-1] < losses[0]


@pytest.mark.parametrize("size", [(8, 5), (1, 3), (3, 1), (2, 2)])
def test_rows_of_the_enlarged_are_those_of_the_whole(size):
    x = torch.randn(2, 4, *size, generator=torch.Generator().manual_seed(1))
    height, width = 2 * size[0], 2 * size[1]
    whole = F.interpolate(x, (height, width), mode="bilinear", align_corners=True)
    for start in range(height):
        for stop in range(start + 1, height + 2):
            rows = doubled_rows(x, start, stop)
            torch.testing.assert_close(rows, whole[..., start:stop, :], rtol=0, atol=1e-6)


def test_fresh_weights_are_kaiming_normal_without_bias():
    net = LLVENet()
    assert all((p == 0).all() for name, p in net.named_parameters() if name.endswith("bias"))
    weight = net.down4.maxpool_conv[1].double_conv[0].weight
    assert weight.std().item() == pytest.approx((2 / (9 * 256)) ** 0.5, rel=0.01)
