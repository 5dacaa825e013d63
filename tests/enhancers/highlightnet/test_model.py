"""The network of HighlightNet: names and shapes, its formula, levels, bands, and training."""

import json
from pathlib import Path

import pytest
import torch

from nat2024_enhancers.highlightnet import model as module
from nat2024_enhancers.highlightnet.model import HighlightNet

GOLDEN = json.loads(
    (Path(__file__).parents[2] / "data" / "highlightnet_golden.json").read_text(encoding="utf-8")
)
GLOBAL = ("TF.", "model.", "F.")
UNUSED = ("TF.norm0.weight", "TF.norm0.bias")


def test_state_dict_has_the_official_names_and_shapes():
    network = HighlightNet()
    assert {k: list(v.shape) for k, v in network.state_dict().items()} == GOLDEN["state_dict"]
    assert sum(p.numel() for p in network.parameters()) == 14_951


def test_brightness_is_raised_to_a_power_and_cut_below_the_level(
    procedural_network, procedural_batch
):
    network = procedural_network(HighlightNet())
    batch = procedural_batch("highlightnet.formula", (2, 3, 21, 33))
    with torch.no_grad():
        enhanced, mask, dark = network(batch)
        levels = network.levels(batch)
    for image, r, t, (l_g, l_b), answer in zip(batch, mask, dark, levels, enhanced, strict=True):
        v = image.mean(dim=0, keepdim=True)
        gain, floor = 0.1 * l_g + 0.2, 0.04 * l_b + 0.06
        cut = 400 * (floor - v) ** 3
        cut[cut < 1e-5] = 1e-6
        expected = image / (v + 1e-6) * (v.clamp(1e-6, 1 - 1e-6) ** (gain**r) - cut)
        torch.testing.assert_close(answer, expected, rtol=0, atol=1e-5)
        assert torch.equal(t, torch.where(v + 1e-6 <= 0.04, answer, 0.0))
    assert dark.any()
    assert not dark.all()


def test_the_mask_is_that_of_the_layers_one_after_the_other(procedural_network, procedural_batch):
    network = procedural_network(HighlightNet())
    value = procedural_batch("highlightnet.mask", (2, 3, 19, 26))[:, :1]
    with torch.no_grad():
        x1 = network.e_conv1(value).relu()
        x2 = network.e_conv2(x1).relu()
        x3 = network.e_conv3(x2).relu()
        x4 = network.e_conv4(x3).relu()
        x5 = network.e_conv5(torch.cat([x3, x4], dim=1)).relu()
        x6 = network.e_conv6(torch.cat([x2, x5], dim=1)).relu()
        expected = network.e_conv7(torch.cat([x1, x6], dim=1)).sigmoid()
        torch.testing.assert_close(network._range_mask(value), expected, rtol=0, atol=1e-6)


def test_bands_equal_the_whole_image(procedural_network, procedural_batch, monkeypatch):
    network = procedural_network(HighlightNet())
    batch = procedural_batch("highlightnet.bands", (2, 3, 40, 24))
    whole = network(batch)[0].detach()
    with torch.no_grad():
        torch.testing.assert_close(network.enhance(batch), whole, rtol=0, atol=1e-6)
        monkeypatch.setattr(module, "_BAND", 1)
        torch.testing.assert_close(network.enhance(batch), whole, rtol=0, atol=1e-6)


@pytest.mark.parametrize("detach", [True, False])
def test_gradient_reaches_the_transformer_only_where_levels_are_not_detached(
    procedural_network, procedural_batch, detach
):
    network = procedural_network(HighlightNet(detach_levels=detach)).train()
    batch = procedural_batch("highlightnet.gradient", (2, 3, 20, 28))
    enhanced, mask, dark = network(batch)
    (enhanced.square().mean() + mask.square().mean() + dark.mean()).backward()
    without = {name for name, p in network.named_parameters() if p.grad is None}
    names = dict(network.named_parameters())
    expected = {name for name in names if name.startswith(GLOBAL)} if detach else set(UNUSED)
    assert without == expected
    assert all(p.grad.isfinite().all() for p in names.values() if p.grad is not None)


def test_detached_levels_are_the_same_numbers(procedural_network, procedural_batch):
    batch = procedural_batch("highlightnet.detach", (1, 3, 20, 28))
    answers = [
        procedural_network(HighlightNet(detach_levels=detach))(batch)[0] for detach in (True, False)
    ]
    assert torch.equal(*answers)


def test_dropout_is_for_training(procedural_network, procedural_batch):
    network = procedural_network(HighlightNet())
    batch = procedural_batch("highlightnet.dropout", (1, 3, 20, 28))
    assert torch.equal(network.levels(batch), network.levels(batch))
    torch.manual_seed(0)
    network.train()
    assert not torch.equal(network.levels(batch), network.levels(batch))


def test_a_few_steps_lower_the_loss(procedural_batch, train_a_little):
    torch.manual_seed(0)
    network = HighlightNet(dropout=0.0).train()
    batch = procedural_batch("highlightnet.train", (2, 3, 24, 24))
    losses = train_a_little(network, batch, rate=1e-2)
    assert losses[-1] < losses[0]
