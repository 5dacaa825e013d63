"""Counting what a network costs: multiply-accumulates and trainable parameters.

Counted are convolutions, transposed convolutions, linear layers and matrix products, those of
attention included; elementwise work is not. What a network is by definition counts, whatever form
computes it (`networks.plain_form`). A multiply-accumulate is two floating-point operations.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import torch
from torch import nn
from torch.nn.attention import SDPBackend, sdpa_kernel
from torch.utils.flop_counter import FlopCounterMode

from nat2024.networks.plain_form import plain_form


def count_macs(model: Callable[..., Any], *inputs: Any) -> int:
    """Multiply-accumulates of one call `model(*inputs)`.

    The call runs as it stands, in the mode (training or evaluation) that the network is in, without
    gradients. Networks and inputs on the device "meta", or made under `FakeTensorMode`, are counted
    without computing anything, so that large networks take no time.

    Args:
        model: a network, or any function that runs one.
        inputs: what it is called with.

    Example:
        >>> count_macs(nn.Conv2d(3, 8, 3, padding=1), torch.zeros(1, 3, 10, 10))
        21600
    """
    counter = FlopCounterMode(display=False)
    with torch.no_grad(), plain_form(), _countable_attention(), counter:
        model(*inputs)
    return int(counter.get_total_flops()) // 2


def count_parameters(model: nn.Module) -> int:
    """Trainable numbers of a network; parameters that several layers share count once."""
    return sum(p.numel() for p in model.parameters() if p.requires_grad)


@contextmanager
def _countable_attention() -> Iterator[None]:
    """Attention as plain matrix products: the fused kernels of a CPU count as zero (torch 2.13)."""
    fast_path = torch.backends.mha.get_fastpath_enabled()
    torch.backends.mha.set_fastpath_enabled(False)
    try:
        with sdpa_kernel(SDPBackend.MATH):
            yield
    finally:
        torch.backends.mha.set_fastpath_enabled(fast_path)
