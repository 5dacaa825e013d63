"""Attention with one number a head, interpolated over queries: equal to that of all pairs."""

import math

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from nat2024_enhancers.ldenhancer import attention
from nat2024_enhancers.ldenhancer.attention import scalar_attention


def exact(query, key, value):
    query, key, value = query.double(), key.double(), value.double()
    return (query @ key.transpose(-1, -2)).softmax(dim=-1) @ value


@pytest.fixture
def kernel_queries(monkeypatch):
    counts = []
    kernel = attention.fused_attention

    def spy(query, key, value):
        counts.append(query.shape[2])
        return kernel(query, key, value)

    monkeypatch.setattr(attention, "fused_attention", spy)
    return counts


@settings(max_examples=15, deadline=None)
@given(
    seed=st.integers(0, 2**31),
    spread=st.sampled_from([0.0, 1e-6, 0.1, 1.0, 3.0]),
    centre=st.floats(-4, 4),
    two_keys=st.booleans(),
)
def test_it_is_attention(seed, spread, centre, two_keys):
    generator = torch.Generator().manual_seed(seed)
    query, key, value = (torch.rand(2, 3, 600, 1, generator=generator) for _ in range(3))
    query, key = spread * (2 * query - 1) + centre, 2 * key - 1
    if two_keys:  # the function with the steepest step
        key = key.sign()
    answer = scalar_attention(query, key, value)
    torch.testing.assert_close(answer.double(), exact(query, key, value), rtol=0, atol=2e-6)


def test_many_queries_cost_few_nodes(kernel_queries):
    torch.manual_seed(0)
    query, key, value = torch.rand(3, 1, 2, 1600, 1).mul(4)
    torch.testing.assert_close(
        scalar_attention(query, key, value).double(),
        exact(query, key, value),
        rtol=0,
        atol=2e-6,
    )
    assert len(kernel_queries) == 1
    assert kernel_queries[0] < 400


@pytest.mark.parametrize("wrong", [1e6, math.nan, math.inf])
def test_queries_too_far_apart_go_to_the_kernel(kernel_queries, wrong):
    torch.manual_seed(0)
    query, key, value = torch.rand(3, 1, 2, 500, 1)
    query[0, 0, 7] = wrong
    answer = scalar_attention(query, key, value)
    assert kernel_queries == [500]
    assert answer[0, 1].isfinite().all()
