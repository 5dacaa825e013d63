"""The networks of SCT, EnlightenGAN, LLVE and RUAS: official names, numbers, bands, training."""

import copy
import json
from pathlib import Path

import pytest
import torch

from nat2024.networks import bands

DATA = Path(__file__).parents[2] / "data"


@pytest.fixture(scope="module")
def golden(row):
    return json.loads((DATA / f"{row.name}_golden.json").read_text(encoding="utf-8"))


@pytest.fixture
def network(row, state):
    net = row.build().eval()
    net.load_state_dict(state)
    return net


@pytest.fixture(scope="module")
def batch(row, procedural_batch):
    return procedural_batch(f"{row.name}.input", (2, 3, 37, 53))


def test_state_dict_has_the_official_names_and_shapes(row, golden):
    net = row.build()
    assert {k: list(v.shape) for k, v in net.state_dict().items()} == golden["state_dict"]
    assert sum(p.numel() for p in net.parameters()) == row.parameters


def test_procedural_weights_give_the_stored_numbers(network, batch, describe, golden):
    with torch.no_grad():
        maps = network.maps(batch) if hasattr(network, "maps") else {}
        arrays = {"enhanced": network(batch), **maps}
    assert arrays.keys() == golden["maps"].keys()
    for name, array in arrays.items():
        actual, expected = describe(array), golden["maps"][name]
        assert actual["shape"] == expected["shape"]
        for key in ("mean", "std", "samples"):
            assert actual[key] == pytest.approx(expected[key], abs=1e-5, rel=1e-5), (name, key)


def test_bands_of_rows_equal_the_whole_image(row, network, procedural_batch, monkeypatch):
    tall = procedural_batch(f"{row.name}.tall", (2, 3, 67, 33))
    with torch.no_grad():
        whole = network(tall)
        monkeypatch.setattr(bands, "BAND_PIXELS", 2 * 33 * row.band)
        banded = network(tall)
    torch.testing.assert_close(banded, whole, rtol=0, atol=2e-6)


def test_inference_and_gradient_forms_agree(network, batch):
    with torch.no_grad():
        inferred = network(batch)
    torch.testing.assert_close(network(batch).detach(), inferred, rtol=1e-5, atol=2e-6)


def test_a_copy_follows_its_own_weights(row, network, batch, state):
    with torch.no_grad():
        before = network(batch)
        other = copy.deepcopy(network)
        other.load_state_dict(
            {k: v * 0.9 if v.is_floating_point() else v for k, v in state.items()}
        )
        assert not torch.equal(other(batch), before)
        fresh = row.build().eval()
        fresh.load_state_dict(other.state_dict())
        assert torch.equal(other(batch), fresh(batch))
        assert torch.equal(network(batch), before)


def test_input_is_not_modified(network, batch):
    given = batch.clone()
    with torch.no_grad():
        network(given)
    assert torch.equal(given, batch)


def test_gradient_reaches_every_parameter(row, state, batch):
    network = row.build(**row.trained)
    network.load_state_dict(state)
    network.train()
    network(batch).square().mean().backward()
    without = [name for name, p in network.named_parameters() if p.grad is None]
    assert not without
    assert all(p.grad.isfinite().all() for p in network.parameters())


def test_a_few_steps_lower_the_loss(row, batch, train_a_little):
    torch.manual_seed(4)
    net = row.build(**row.trained).train()
    losses = train_a_little(net, batch[:1, :, :32, :32], rate=row.rate, steps=3)
    assert losses[-1] < losses[0]
