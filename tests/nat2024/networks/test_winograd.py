"""Winograd's form gives what the plain sum gives, for every shape, and loses next to nothing."""

import pytest
import torch
import torch.nn.functional as F
from hypothesis import given
from hypothesis import strategies as st

from nat2024.networks import winograd
from nat2024.networks.winograd import OUTPUTS, WinogradConvolution, transforms


@pytest.mark.parametrize("kernel", [3, 5])
def test_the_matrices_are_an_identity(kernel):
    """Of every input and every tap alone, and so of all: the form is linear in both."""
    matrices = transforms(kernel)
    side = OUTPUTS + kernel - 1
    for place in range(side):
        for tap in range(kernel):
            inputs, taps = torch.eye(side)[place].double(), torch.eye(kernel)[tap].double()
            found = matrices.outputs @ ((matrices.weights @ taps) * (matrices.inputs @ inputs))
            wanted = torch.zeros(OUTPUTS).double()
            if 0 <= place - tap < OUTPUTS:
                wanted[place - tap] = 1
            torch.testing.assert_close(found, wanted, rtol=0, atol=1e-12)


@given(
    kernel=st.sampled_from([3, 5]),
    size=st.tuples(st.integers(5, 23), st.integers(5, 23)),
    count=st.integers(1, 3),
    padding=st.integers(0, 2),
    has_bias=st.booleans(),
    layout=st.sampled_from([torch.contiguous_format, torch.channels_last]),
    tiles=st.sampled_from([1, 5, 128]),
)
def test_it_is_the_convolution(kernel, size, count, padding, has_bias, layout, tiles):
    generator = torch.Generator().manual_seed(kernel + 100 * count + sum(size))
    maps = torch.randn(count, 3, *size, generator=generator).contiguous(memory_format=layout)
    weight = torch.randn(4, 3, kernel, kernel, generator=generator)
    bias = torch.randn(4, generator=generator) if has_bias else None
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(winograd, "_TILES", tiles)
        found = WinogradConvolution(weight, bias)(maps, padding)
    wanted = F.conv2d(maps, weight, bias, padding=padding)
    assert found.shape == wanted.shape
    assert found.is_contiguous(memory_format=torch.channels_last)
    torch.testing.assert_close(found, wanted, rtol=0, atol=1e-5 * float(wanted.abs().max()))


@pytest.mark.parametrize(("kernel", "allowed"), [(3, 3e-6), (5, 1e-5)])
def test_it_loses_little_to_rounding(kernel, allowed):
    torch.manual_seed(0)
    maps = torch.randn(1, 384, 20, 20).relu()
    weight, bias = torch.randn(64, 384, kernel, kernel) / (20 * kernel), torch.randn(64)
    exact = F.conv2d(maps.double(), weight.double(), bias.double())
    away = (WinogradConvolution(weight, bias)(maps) - exact).abs().max()
    assert away < allowed * exact.abs().max()


def test_inputs_are_left_as_they_are():
    maps = torch.ones(1, 2, 8, 8)
    WinogradConvolution(torch.ones(2, 2, 3, 3), None)(maps, 1)
    torch.testing.assert_close(maps, torch.ones(1, 2, 8, 8), rtol=0, atol=0)
