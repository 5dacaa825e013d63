"""The network of DarkLighter: official names and shapes, its steps, bands, and training."""

import json
from pathlib import Path

import torch

from nat2024_enhancers.darklighter import model as module
from nat2024_enhancers.darklighter.model import DarkLighterNet

GOLDEN = json.loads(
    (Path(__file__).parents[2] / "data" / "darklighter_golden.json").read_text(encoding="utf-8")
)


def test_state_dict_has_the_official_names_and_shapes():
    network = DarkLighterNet()
    assert {k: list(v.shape) for k, v in network.state_dict().items()} == GOLDEN["state_dict"]
    assert sum(p.numel() for p in network.parameters()) == 74_768


def test_eight_steps_take_noise_away_and_light_up(procedural_network, procedural_batch):
    batch = procedural_batch("darklighter.steps", (2, 3, 31, 45))
    with torch.no_grad():
        enhanced, light, noise = procedural_network(DarkLighterNet())(batch)
    image = batch
    for step in range(8):
        image = (image - noise[:, step : step + 1]) * light[:, step : step + 1]
    torch.testing.assert_close(enhanced, image, rtol=1e-5, atol=1e-5)
    assert 0 <= light.min() < light.max() <= 2
    assert -1 <= noise.min() < noise.max() <= 1


def test_bands_equal_the_whole_image(procedural_network, procedural_batch, monkeypatch):
    network = procedural_network(DarkLighterNet())
    batch = procedural_batch("darklighter.bands", (2, 3, 40, 24))
    whole = network(batch)[0].detach()
    with torch.no_grad():
        torch.testing.assert_close(network.enhance(batch), whole, rtol=1e-5, atol=1e-5)
        monkeypatch.setattr(module, "_BAND", 1)
        torch.testing.assert_close(network.enhance(batch), whole, rtol=1e-5, atol=1e-5)


def test_gradient_reaches_every_parameter_and_the_image(procedural_network, procedural_batch):
    network = procedural_network(DarkLighterNet()).train()
    batch = procedural_batch("darklighter.gradient", (2, 3, 20, 28)).requires_grad_()
    enhanced, light, noise = network(batch)
    (enhanced.square().mean() + light.square().mean() + noise.square().mean()).backward()
    for name, tensor in (*network.named_parameters(), ("image", batch)):
        assert tensor.grad is not None, name
        assert tensor.grad.isfinite().all(), name
        assert tensor.grad.any(), name


def test_a_few_steps_lower_the_loss(procedural_batch, train_a_little):
    torch.manual_seed(0)
    network = DarkLighterNet().train()
    batch = procedural_batch("darklighter.train", (2, 3, 24, 24))
    losses = train_a_little(network, batch, rate=1e-3)
    assert losses[-1] < losses[0]
