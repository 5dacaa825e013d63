"""A convolution of two inputs is the convolution of both together."""

import pytest
import torch
from torch import nn

from nat2024.networks.convolving import convolve_pair


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
