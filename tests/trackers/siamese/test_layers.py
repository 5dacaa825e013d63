"""Layers that are merged at inference give what their parts give, and follow their weights."""

import copy

import pytest
import torch
from torch import nn

from nat2024_trackers.siamese.layers import Layers, conv_batch_norm, conv_group_norm, tower


@pytest.fixture
def layers():
    torch.manual_seed(0)
    made = Layers(
        *conv_batch_norm(5, 64, padding=1),
        *conv_batch_norm(64, 32, size=1, bias=False),
        *conv_group_norm(32, 64),
        nn.Conv2d(64, 3, 3),
    ).eval()
    for layer in made:
        if isinstance(layer, nn.BatchNorm2d):
            nn.init.normal_(layer.running_mean)
            nn.init.uniform_(layer.running_var, 0.1, 2)
            nn.init.normal_(layer.weight)
    return made


def test_inference_gives_what_the_parts_give(layers):
    maps = torch.randn(2, 5, 9, 7)
    before = maps.clone()
    plain = layers(maps)
    assert plain.requires_grad
    with torch.no_grad():
        torch.testing.assert_close(layers(maps), plain.detach(), rtol=1e-4, atol=1e-4)
    assert torch.equal(maps, before)


@torch.no_grad()
def test_new_weights_take_effect_at_once(layers):
    maps = torch.randn(1, 5, 9, 7)
    before = layers(maps)
    twin = copy.deepcopy(layers)
    state = {
        key: value + 0.1 for key, value in layers.state_dict().items() if value.is_floating_point()
    }
    layers.load_state_dict(state, strict=False)
    expected = maps
    for layer in layers:
        expected = layer(expected)
    torch.testing.assert_close(layers(maps), expected, rtol=1e-4, atol=1e-4)
    assert not torch.allclose(before, expected, atol=1e-2)
    assert torch.equal(twin(maps), before)


def test_statistics_are_gathered_in_training(layers):
    with torch.no_grad():
        layers.train()(torch.randn(2, 5, 9, 7))
    assert layers[1].num_batches_tracked == 1


def test_towers_have_official_places():
    with torch.device("meta"):
        classes, boxes = tower(64, 2), tower(64, 4, 4)
        assert boxes(torch.empty(1, 64, 21, 21)).shape == (1, 4, 21, 21)
    places = [name for name, m in boxes.named_children() if isinstance(m, nn.Conv2d)]
    assert places == ["0", "3", "6", "9", "12"]
    assert [m.num_groups for m in boxes if isinstance(m, nn.GroupNorm)] == [32] * 4
    assert isinstance(classes[-1], nn.ReLU)
