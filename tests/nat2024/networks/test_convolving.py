"""Convolutions at inference are those of `torch.nn`, in whatever form they are computed."""

import copy

import pytest
import torch
from torch import nn
from torch._subclasses.fake_tensor import FakeTensorMode

from nat2024.networks import convolving
from nat2024.networks.convolving import (
    Convolution,
    FastConv2d,
    convolve_pair,
)
from nat2024.networks.macs import count_macs
from nat2024.networks.plain_form import plain_form


@pytest.mark.parametrize(
    ("widths", "settings"),
    [
        ((4, 4), {"padding": 1}),
        ((2, 6), {"padding": 1, "stride": 2}),
        ((5, 3), {"padding": 2, "dilation": 2, "bias": False}),
    ],
)
@pytest.mark.parametrize("layout", [torch.contiguous_format, torch.channels_last])
def test_it_equals_the_layer_on_both_together(widths, settings, layout):
    torch.manual_seed(0)
    layer = nn.Conv2d(8, 3, 3, **settings)
    first, second = (
        torch.rand(2, width, 9, 11).contiguous(memory_format=layout) for width in widths
    )
    expected = layer(torch.cat([first, second], dim=1))
    torch.testing.assert_close(convolve_pair(layer, first, second), expected, rtol=0, atol=1e-6)


def test_gradients_are_those_of_the_layer_on_both_together():
    torch.manual_seed(1)
    layer = nn.Conv2d(4, 3, 3, padding=1)
    first, second = torch.rand(2, 1, 2, 5, 6, requires_grad=True)
    convolve_pair(layer, first, second).square().sum().backward()
    split = layer.weight.grad.clone()
    layer.zero_grad()
    layer(torch.cat([first, second], dim=1)).square().sum().backward()
    torch.testing.assert_close(split, layer.weight.grad, rtol=0, atol=1e-5)


@pytest.fixture
def transformed(monkeypatch):
    """The kernels of all convolutions that were computed in Winograd's form."""
    seen = []

    class Watched(convolving.WinogradConvolution):
        def __call__(self, maps, padding=0):
            seen.append(self.kernel)
            return super().__call__(maps, padding)

    monkeypatch.setattr(convolving, "WinogradConvolution", Watched)
    return seen


def layer_of(channels_in=64, channels_out=64, size=3, **settings):
    torch.manual_seed(0)
    return nn.Conv2d(channels_in, channels_out, size, **settings)


@pytest.mark.parametrize(
    ("layer", "side", "is_transformed"),
    [
        (layer_of(padding=1), 12, True),
        (layer_of(48, 96, 5), 12, True),
        (layer_of(bias=False), 12, True),
        (layer_of(32, 64), 12, False),
        (layer_of(), 9, False),
        (layer_of(stride=2), 30, False),
        (layer_of(dilation=2), 30, False),
        (layer_of(128, 128, groups=2), 12, False),
        (layer_of(size=1), 12, False),
        (layer_of(size=(1, 3), padding=(0, 1)), 12, False),
        (layer_of(padding=(1, 0)), 12, False),
    ],
)
def test_a_convolution_is_the_layer(transformed, layer, side, is_transformed):
    maps = torch.randn(2, layer.in_channels, side, side)
    with torch.no_grad():
        found, wanted = Convolution.of(layer)(maps), layer(maps)
    torch.testing.assert_close(found, wanted, rtol=0, atol=1e-5 * float(wanted.abs().max()))
    assert bool(transformed) == is_transformed


def test_a_norm_is_folded_in():
    layer, norm = layer_of(padding=1), nn.BatchNorm2d(64).eval()
    norm.running_mean.uniform_(-1, 1)
    norm.running_var.uniform_(0.5, 2)
    maps = torch.randn(1, 64, 12, 12)
    with torch.no_grad():
        found, wanted = Convolution.of(layer, norm)(maps), norm(layer(maps))
    torch.testing.assert_close(found, wanted, rtol=0, atol=1e-5)


def test_only_float32_with_numbers_is_transformed(transformed):
    layer = layer_of().double()
    with torch.no_grad():
        Convolution.of(layer)(torch.randn(1, 64, 12, 12).double())
        with FakeTensorMode(allow_non_fake_inputs=True):
            assert Convolution.of(layer_of())(torch.empty(1, 64, 12, 12)).shape == (1, 64, 10, 10)
        with plain_form():
            Convolution.of(layer_of())(torch.randn(1, 64, 12, 12))
        with torch.autocast("cpu", torch.bfloat16):
            assert Convolution.of(layer_of())(torch.randn(1, 64, 12, 12)).dtype == torch.bfloat16
        assert Convolution.of(layer_of())(torch.empty(0, 64, 12, 12)).shape == (0, 64, 10, 10)
    assert not transformed


def test_transforms_made_under_inference_mode_serve_elsewhere():
    convolution, maps = Convolution.of(layer_of()), torch.randn(1, 64, 12, 12)
    with torch.inference_mode():
        first = convolution(maps)
    with torch.no_grad():
        torch.testing.assert_close(convolution(maps), first.clone(), rtol=0, atol=0)


def test_a_fast_layer_is_a_plain_one_but_for_its_form(transformed):
    fast, plain = FastConv2d(64, 64, 3, padding=1).eval(), layer_of(padding=1)
    fast.load_state_dict(plain.state_dict())
    twin = copy.deepcopy(fast)
    maps = torch.randn(1, 64, 12, 12)
    torch.testing.assert_close(fast(maps), plain(maps), rtol=0, atol=1e-5)
    assert not transformed  # with gradients
    with torch.no_grad():
        torch.testing.assert_close(fast(maps), plain(maps), rtol=0, atol=1e-5)
        fast.weight.mul_(2)
        plain.weight.mul_(2)
        torch.testing.assert_close(fast(maps), plain(maps), rtol=0, atol=1e-5)
        assert not torch.equal(twin(maps), fast(maps))
        assert len(transformed) == 4
        fast.train()(maps)
        assert len(transformed) == 4
    assert count_macs(fast.eval(), maps) == count_macs(plain, maps) == 12 * 12 * 64 * 64 * 9
