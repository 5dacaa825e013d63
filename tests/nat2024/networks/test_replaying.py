"""On a CPU a replayed function is the function; tests/test_cuda.py has what a CUDA device does."""

import copy
import pickle

import torch
from torch import nn

from nat2024.networks.replaying import Replayed


def test_on_a_cpu_the_function_is_called():
    layer = nn.Linear(3, 2)
    replayed = Replayed(layer, layer.forward)
    rows = torch.rand(4, 3)
    for _ in range(6):
        torch.testing.assert_close(replayed(rows), layer(rows), rtol=0, atol=0)
    assert replayed(rows).requires_grad
    with torch.inference_mode():
        assert not replayed(rows).requires_grad


def test_it_is_copied_and_pickled_with_its_module():
    layer = nn.Linear(3, 2)
    replayed = Replayed(layer, layer.forward)
    rows = torch.rand(4, 3)
    for other in (copy.deepcopy(replayed), pickle.loads(pickle.dumps(replayed))):
        assert other.module is not layer
        torch.testing.assert_close(other(rows), layer(rows))
        with torch.no_grad():
            other.module.weight.zero_()
        assert not torch.allclose(other(rows), layer(rows))
