import pytest
import torch
from torch import nn

from nat2024_trackers.hift.attention import Attention, to_maps, to_tokens

CHANNELS = 24


@pytest.fixture
def pair():
    """PyTorch's own attention and ours, with the same weights."""
    torch.manual_seed(0)
    official = nn.MultiheadAttention(CHANNELS, 6, batch_first=True).eval()
    nn.init.normal_(official.in_proj_bias)
    nn.init.normal_(official.out_proj.bias)
    ours = Attention(CHANNELS, 6).eval()
    ours.load_state_dict(official.state_dict())
    return official, ours


@pytest.mark.parametrize("sources", ["aaa", "aab", "abb", "aba", "abc"])
@pytest.mark.parametrize("masked", [False, True])
def test_it_equals_the_attention_of_pytorch(pair, sources, masked):
    official, ours = pair
    tokens = {name: torch.randn(2, 9, CHANNELS) for name in "abc"}
    inputs = [tokens[name] for name in sources]
    mask = torch.randn(9, 9) if masked else None
    with torch.no_grad():
        expected = official(*inputs, attn_mask=mask)[0]
        torch.testing.assert_close(ours(*inputs, mask), expected, rtol=1e-5, atol=1e-6)


def test_fresh_weights_are_spread_as_those_of_pytorch():
    torch.manual_seed(1)
    ours = Attention(192, 6)
    limit = (6 / (192 + 3 * 192)) ** 0.5
    assert float(ours.in_proj_weight.detach().abs().max()) == pytest.approx(limit, rel=1e-2)
    assert not ours.in_proj_bias.any()
    assert not ours.out_proj.bias.any()


def test_tokens_are_cells_row_by_row():
    maps = torch.arange(2 * 3 * 4 * 5.0).view(2, 3, 4, 5)
    tokens = to_tokens(maps)
    assert tokens.shape == (2, 20, 3)
    assert torch.equal(tokens[1, 7], maps[1, :, 1, 2])
    assert torch.equal(to_maps(tokens, (4, 5)), maps)
