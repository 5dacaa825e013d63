"""On a CPU a replayed function is the function; tests/test_cuda.py has what a CUDA device does."""

import copy
import pickle

import torch
from torch import nn

from nat2024.networks.replaying import Replayed, _Scout


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


def test_each_further_shape_is_recorded_later(monkeypatch):
    recorded = []
    monkeypatch.setattr(Replayed, "_record", lambda _, inputs: recorded.append(len(inputs[0])))
    layer = nn.Linear(3, 2)
    replayed = Replayed(layer, layer.forward)
    for count, calls, known in ((5, 3, 0), (5, 9, 1), (4, 12, 1), (4, 9, 2), (3, 27, 2), (3, 9, 3)):
        for _ in range(calls):
            rows = torch.rand(count, 3)
            torch.testing.assert_close(replayed._answer((rows,)), layer(rows))
        assert recorded == [5, 4, 3][:known]
    with torch.no_grad():
        layer.weight.add_(1)  # other weights, so nothing is known of any shape
    for _ in range(4):
        replayed._answer((torch.rand(3, 3),))
    assert recorded == [5, 4, 3, 3]


def test_what_cannot_be_recorded_is_seen_in_a_call():
    for function, obstacle in (
        (lambda rows: rows * float(rows.sum()), "_local_scalar_dense"),
        (lambda rows: rows[rows > 0], "index"),
        (lambda rows: rows.nonzero(), "nonzero"),
        (lambda rows: rows[torch.tensor([0, 1])], ""),
        (lambda rows: rows.relu(), ""),
        (lambda rows: rows.to("meta"), "_to_copy"),
    ):
        with _Scout() as scout:
            function(torch.ones(3))
        assert scout.obstacle == obstacle
