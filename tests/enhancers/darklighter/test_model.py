"""The network of DarkLighter: official names and shapes, its steps, bands, and training."""

import json
from pathlib import Path

import torch
import torch.nn.functional as F

from nat2024_enhancers.darklighter import model as module
from nat2024_enhancers.darklighter.model import DarkLighterNet

GOLDEN = json.loads(
    (Path(__file__).parents[2] / "data" / "darklighter_golden.json").read_text(encoding="utf-8")
)


def make_network(procedural_state):
    network = DarkLighterNet().eval()
    network.load_state_dict(procedural_state(network))
    return network


def test_state_dict_has_the_official_names_and_shapes():
    network = DarkLighterNet()
    assert {k: list(v.shape) for k, v in network.state_dict().items()} == GOLDEN["state_dict"]
    assert sum(p.numel() for p in network.parameters()) == 74_768


def test_eight_steps_take_noise_away_and_light_up(procedural_state, procedural_batch):
    batch = procedural_batch("darklighter.steps", (2, 3, 31, 45))
    with torch.no_grad():
        enhanced, light, noise = make_network(procedural_state)(batch)
    image = batch
    for step in range(8):
        image = (image - noise[:, step : step + 1]) * light[:, step : step + 1]
    torch.testing.assert_close(enhanced, image, rtol=1e-5, atol=1e-5)
    assert 0 <= light.min() < light.max() <= 2
    assert -1 <= noise.min() < noise.max() <= 1


def test_bands_equal_the_whole_image(procedural_state, procedural_batch, monkeypatch):
    network = make_network(procedural_state)
    batch = procedural_batch("darklighter.bands", (2, 3, 40, 24))
    whole = network(batch)[0].detach()
    with torch.no_grad():
        torch.testing.assert_close(network.enhance(batch), whole, rtol=1e-5, atol=1e-5)
        monkeypatch.setattr(module, "_BAND", 1)
        torch.testing.assert_close(network.enhance(batch), whole, rtol=1e-5, atol=1e-5)


def test_gradient_reaches_every_parameter_and_the_image(procedural_state, procedural_batch):
    network = make_network(procedural_state).train()
    batch = procedural_batch("darklighter.gradient", (2, 3, 20, 28)).requires_grad_()
    enhanced, light, noise = network(batch)
    (enhanced.square().mean() + light.square().mean() + noise.square().mean()).backward()
    for name, tensor in (*network.named_parameters(), ("image", batch)):
        assert tensor.grad is not None, name
        assert tensor.grad.isfinite().all(), name
        assert tensor.grad.any(), name


def test_a_few_steps_lower_the_loss(procedural_batch):
    torch.manual_seed(0)
    network = DarkLighterNet().train()
    batch = procedural_batch("darklighter.train", (2, 3, 24, 24))
    optimiser = torch.optim.Adam(network.parameters(), lr=1e-3)
    losses = []
    for _ in range(8):
        loss = F.mse_loss(network(batch)[0], torch.full_like(batch, 0.6))
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        losses.append(loss.item())
    assert losses[-1] < losses[0]
