"""Folded layers equal the two they replace, and follow every change of the weights."""

import copy

import pytest
import torch
from torch import nn

from nat2024.networks.folding import Derived, fold_batch_norm, may_derive


def _norm(channels):
    norm = nn.BatchNorm2d(channels).eval()
    with torch.no_grad():
        norm.weight.uniform_(0.5, 2)
        norm.bias.uniform_(-1, 1)
    norm.running_mean.uniform_(-1, 1)
    norm.running_var.uniform_(0.2, 3)
    return norm


@pytest.mark.parametrize(
    "layer",
    [
        nn.Conv2d(4, 6, 3, padding=1),
        nn.Conv2d(6, 6, 3, groups=6, bias=False),
        nn.ConvTranspose2d(4, 6, 2, 2),
    ],
)
def test_one_layer_equals_two(layer):
    torch.manual_seed(0)
    norm = _norm(6)
    image = torch.rand(2, layer.in_channels, 8, 9)
    with torch.no_grad():
        weight, bias = fold_batch_norm(layer, norm)
        expected = norm(layer(image))
        if isinstance(layer, nn.ConvTranspose2d):
            folded = nn.functional.conv_transpose2d(image, weight, bias, layer.stride)
        else:
            folded = nn.functional.conv2d(
                image, weight, bias, padding=layer.padding, groups=layer.groups
            )
    torch.testing.assert_close(folded, expected, rtol=1e-5, atol=1e-5)


def test_a_norm_without_statistics_is_refused():
    norm = nn.BatchNorm2d(3, track_running_stats=False)
    with pytest.raises(ValueError, match="running statistics"):
        fold_batch_norm(nn.Conv2d(3, 3, 1), norm)


def test_derived_follows_every_change():
    layer = nn.Linear(2, 2)
    calls = []

    def compute():
        calls.append(1)
        return layer.weight.detach().sum().item()

    derived = Derived(layer, compute)
    assert derived() == derived() == layer.weight.sum().item()
    assert len(calls) == 1
    layer.load_state_dict({"weight": torch.ones(2, 2), "bias": torch.zeros(2)})
    assert derived() == 4
    layer.load_state_dict({"weight": torch.eye(2), "bias": torch.zeros(2)}, assign=True)
    assert derived() == 2
    with torch.no_grad():
        layer.weight.mul_(3)
    assert derived() == 6
    layer.weight = nn.Parameter(torch.zeros(2, 2))
    assert derived() == 0
    assert len(calls) == 5


class _Doubled(nn.Module):
    def __init__(self):
        super().__init__()
        self.layer = nn.Linear(1, 1, bias=False)
        self.doubled = Derived(self, self._double)

    def _double(self):
        return self.layer.weight.item() * 2


def test_a_copy_derives_from_its_own_weights():
    module = _Doubled()
    before = module.doubled()
    other = copy.deepcopy(module)
    nn.init.constant_(other.layer.weight, 3)
    assert (module.doubled(), other.doubled()) == (before, 6)
    nn.init.constant_(module.layer.weight, 4)
    assert (module.doubled(), other.doubled()) == (8, 6)


def test_an_optimizer_step_a_moved_module_and_inference_weights_are_noticed():
    module = _Doubled()
    nn.init.constant_(module.layer.weight, 3)
    assert module.doubled() == 6
    module.layer.weight.grad = torch.ones(1, 1)
    torch.optim.SGD(module.parameters(), lr=1.0).step()
    assert module.doubled() == 4
    module.double()
    module.layer.weight = nn.Parameter(torch.full((1, 1), 5.0))
    assert module.doubled() == 10
    with torch.inference_mode():
        made_there = _Doubled()
        for value in (1.0, 2.0):
            made_there.layer.weight.fill_(value)
            assert made_there.doubled() == 2 * value


def test_nothing_is_derived_in_training():
    layer = nn.Linear(2, 2)
    assert not may_derive(layer)
    layer.eval()
    assert not may_derive(layer)
    with torch.no_grad():
        assert may_derive(layer)
