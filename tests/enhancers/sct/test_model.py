"""The network: official names and shapes, numbers, bands of rows, and training."""

import copy
import json
from pathlib import Path

import pytest
import torch
import torch.nn.functional as F

from nat2024.networks import bands
from nat2024_enhancers.sct.attention import (
    NormedConvolution,
    from_windows,
    relative_positions,
    to_windows,
)
from nat2024_enhancers.sct.model import SCTNet

GOLDEN = json.loads(
    (Path(__file__).parents[2] / "data" / "sct_golden.json").read_text(encoding="utf-8")
)


@pytest.fixture(scope="module")
def state(procedural_state):
    return procedural_state(SCTNet())


@pytest.fixture
def network(state):
    net = SCTNet().eval()
    net.load_state_dict(state)
    return net


@pytest.fixture(scope="module")
def batch(procedural_batch):
    return procedural_batch("sct.input", (2, 3, 37, 53))


def test_state_dict_has_the_official_names_and_shapes():
    net = SCTNet()
    assert {k: list(v.shape) for k, v in net.state_dict().items()} == GOLDEN["state_dict"]
    assert sum(p.numel() for p in net.parameters()) == 7_913_774


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
    tall = procedural_batch("sct.tall", (2, 3, 67, 33))
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
        fresh = SCTNet().eval()
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
    net = SCTNet().train()
    optimiser = torch.optim.Adam(net.parameters(), lr=1e-4)
    losses = []
    for _ in range(3):
        loss = F.mse_loss(net(batch[:1, :, :32, :32]), torch.full((1, 3, 32, 32), 0.6))
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        losses.append(loss.item())
    assert losses[-1] < losses[0]


def test_relative_positions_are_those_of_a_window():
    index = relative_positions(4)
    assert index.dtype == torch.int64
    assert index[0, 0] == index[5, 5] == 24
    assert index[0, 1] == 23
    assert index[0, 4] == 24 - 7
    assert index[15, 0] == 48
    assert index[0, 15] == 0


def test_windows_are_cut_and_put_back():
    tokens = torch.arange(2 * 64 * 3, dtype=torch.float32).view(2, 64, 3)
    windows = to_windows(tokens, 8)
    assert torch.equal(windows[1, :, 0], tokens[0].view(8, 8, 3)[:4, 4:, 0].flatten())
    assert torch.equal(from_windows(windows, 8), tokens)


@pytest.mark.parametrize("kernel", [1, 3])
def test_folding_follows_weights_and_modes(kernel):
    torch.manual_seed(5)
    layer = NormedConvolution(8, kernel, 8 if kernel == 3 else 1, "running").eval()
    x = torch.randn(2, 8, 6, 6)
    for _ in range(2):
        with torch.no_grad():
            layer.conv[1].running_mean.normal_()
            layer.conv[1].weight.normal_()
            expected = F.gelu(layer.conv(x))
            torch.testing.assert_close(layer(x), expected, rtol=0, atol=1e-5)
    assert layer(x).requires_grad


def test_image_statistics_are_those_of_training_with_single_images(procedural_batch, state):
    by_image = SCTNet(statistics="image").eval()
    by_image.load_state_dict(state)
    trained = SCTNet()
    trained.load_state_dict(state)
    for layer in (trained.encoderlayer_0, trained.encoderlayer_1):
        layer.blocks[0].drop_path = 0.0
    trained.train()
    images = procedural_batch("sct.statistics", (2, 3, 40, 50))
    with torch.no_grad():
        single = torch.cat([trained(image[None]) for image in images])
        torch.testing.assert_close(by_image(images), single, rtol=1e-4, atol=1e-5)


def test_training_drops_branches_of_the_second_layer_only(network, batch):
    network.train()
    first, second = network.encoderlayer_0.blocks[0], network.encoderlayer_1.blocks[0]
    ones = torch.ones(4000, 1, 1)
    assert torch.equal(first._drop(ones), ones)
    torch.manual_seed(6)
    dropped = second._drop(ones)
    assert dropped.unique().tolist() == pytest.approx([0.0, 1 / 0.9])
    assert dropped.mean().item() == pytest.approx(1.0, abs=0.03)
    network.eval()
    assert torch.equal(second._drop(ones), ones)
