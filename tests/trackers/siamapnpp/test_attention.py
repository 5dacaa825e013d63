"""The attention of SiamAPN++ against sums written out."""

import pytest
import torch

from nat2024_trackers.siamapnpp.model import ChannelAttention, CrossAggregation, PointAttention


def filled(module):
    torch.manual_seed(0)
    for parameter in module.parameters():
        torch.nn.init.normal_(parameter, std=0.2)
    return module.eval()


@torch.no_grad()
def test_cells_attend_to_each_other_without_scaling():
    layer = filled(PointAttention())
    maps = torch.randn(2, 256, 3, 4)
    query = layer.query_conv(maps)[1, :, 2, 1]
    keys = layer.key_conv(maps)[1].flatten(1)
    shares = torch.softmax(query @ keys, dim=0)
    mixed = layer.value_conv(maps)[1].flatten(1) @ shares
    expected = maps[1, :, 2, 1] + layer.gamma * mixed
    torch.testing.assert_close(layer(maps)[1, :, 2, 1], expected, rtol=1e-4, atol=1e-4)


@torch.no_grad()
def test_channels_are_weighed_by_their_largest_and_mean_value():
    layer = filled(ChannelAttention())
    maps = torch.randn(2, 256, 3, 4)
    squeeze, excite = layer.fc1.weight.flatten(1), layer.fc2.weight.flatten(1)
    pooled = (maps[1].flatten(1).max(1).values, maps[1].flatten(1).mean(1))
    weight = torch.sigmoid(sum(excite @ torch.relu(squeeze @ one) for one in pooled))
    expected = maps[1, :, 0, 3] * (1 + layer.gamma2 * weight)
    torch.testing.assert_close(layer(maps)[1, :, 0, 3], expected, rtol=1e-4, atol=1e-4)


@torch.no_grad()
def test_another_map_strengthens_as_a_whole_and_by_channel():
    layer = filled(CrossAggregation())
    maps, other = torch.randn(2, 2, 256, 3, 4).unbind(0)
    squeeze, excite = layer.fc1.weight.flatten(1), layer.fc2.weight.flatten(1)
    weight = torch.sigmoid(excite @ torch.relu(squeeze @ other[1].mean((1, 2))))
    both = torch.cat([maps[1, :, 2, 0], other[1, :, 2, 0]])
    joined = torch.relu(layer.add.weight.flatten(1).t() @ both + layer.add.bias)
    expected = maps[1, :, 2, 0] * (1 + layer.gamma3 * weight) + layer.gamma1 * joined
    torch.testing.assert_close(layer(maps, other)[1, :, 2, 0], expected, rtol=1e-4, atol=1e-4)


@pytest.mark.parametrize("make", [CrossAggregation, ChannelAttention, PointAttention])
def test_fresh_attention_changes_nothing(make):
    maps = torch.randn(1, 256, 3, 3)
    layer = make().eval()
    inputs = (maps, maps) if make is CrossAggregation else (maps,)
    assert torch.equal(layer(*inputs), maps)
