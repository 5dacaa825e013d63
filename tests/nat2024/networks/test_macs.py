"""Counts equal those by hand, attention included, and counting leaves nothing behind."""

import pytest
import torch
import torch.nn.functional as F
from torch import nn
from torch._subclasses.fake_tensor import FakeTensorMode

from nat2024.networks.macs import count_macs, count_parameters


@pytest.mark.parametrize(
    ("layer", "shape", "macs"),
    [
        (nn.Conv2d(3, 8, 3, padding=1), (1, 3, 10, 12), 8 * 3 * 9 * 10 * 12),
        (nn.Conv2d(3, 8, 5, stride=2), (2, 3, 11, 11), 2 * 8 * 3 * 25 * 4 * 4),
        (nn.Conv2d(8, 8, 3, padding=1, groups=8), (1, 8, 6, 6), 8 * 9 * 36),
        (nn.Conv2d(4, 4, 3, dilation=2), (1, 4, 9, 9), 4 * 4 * 9 * 25),
        (nn.ConvTranspose2d(6, 4, 2, 2), (1, 6, 5, 7), 6 * 4 * 4 * 5 * 7),
        (nn.ConvTranspose2d(5, 3, 3), (1, 5, 4, 4), 5 * 3 * 9 * 16),
        (nn.Linear(16, 32), (7, 16), 7 * 16 * 32),
        (nn.Linear(16, 32, bias=False), (2, 7, 16), 14 * 16 * 32),
        (nn.BatchNorm2d(4), (1, 4, 8, 8), 0),
        (nn.ReLU(), (1, 4, 8, 8), 0),
    ],
    ids=lambda value: type(value).__name__ if isinstance(value, nn.Module) else "",
)
def test_layers_count_as_by_hand(layer, shape, macs):
    assert count_macs(layer.eval(), torch.rand(shape)) == macs


def test_products_of_fused_attention_count():
    batch, heads, tokens, width = 1, 8, 256, 8
    q = torch.rand(batch, heads, tokens, width)
    # each head: tokens x tokens x width for the scores, and again for the weighted sum
    wanted = 2 * heads * tokens * tokens * width
    assert wanted == 8_388_608
    assert count_macs(F.scaled_dot_product_attention, q, q, q) == wanted


@pytest.mark.parametrize("training", [False, True])
def test_the_attention_module_counts_projections_and_products(training):
    module = nn.MultiheadAttention(64, 4, batch_first=True).train(training)
    tokens = torch.rand(2, 128, 64)
    projections = 2 * 128 * 4 * 64 * 64
    products = 2 * 2 * 128 * 128 * 64
    assert count_macs(module, tokens, tokens, tokens) == projections + products


def test_a_transformer_layer_in_evaluation_mode_counts():
    layer = nn.TransformerEncoderLayer(32, 4, dim_feedforward=48, batch_first=True).eval()
    macs = count_macs(layer, torch.rand(1, 20, 32))
    assert macs == 20 * (4 * 32 * 32 + 2 * 32 * 48) + 2 * 20 * 20 * 32


@pytest.mark.parametrize("fast", [True, False])
@pytest.mark.parametrize("fails", [False, True])
def test_settings_are_as_before_also_after_an_error(fast, fails):
    before = torch.backends.mha.get_fastpath_enabled()
    flash = torch.backends.cuda.flash_sdp_enabled()

    def call(x):
        assert not torch.backends.mha.get_fastpath_enabled()
        assert not torch.is_grad_enabled()
        if fails:
            raise ValueError("of the network")

    torch.backends.mha.set_fastpath_enabled(fast)
    try:
        if fails:
            with pytest.raises(ValueError, match="of the network"):
                count_macs(call, torch.zeros(1))
        else:
            assert count_macs(call, torch.zeros(1)) == 0
        assert torch.backends.mha.get_fastpath_enabled() is fast
        assert torch.backends.cuda.flash_sdp_enabled() is flash
        assert torch.is_grad_enabled()
    finally:
        torch.backends.mha.set_fastpath_enabled(before)


def test_nothing_is_computed_on_the_meta_device_or_with_fake_tensors():
    wanted = 64 * 64 * 9 * 4096**2  # half a day of a processor
    with torch.device("meta"):
        layer = nn.Conv2d(64, 64, 3, padding=1)
        assert count_macs(layer, torch.empty(1, 64, 4096, 4096)) == wanted
    layer = nn.Conv2d(64, 64, 3, padding=1)
    with FakeTensorMode(allow_non_fake_inputs=True):
        assert count_macs(layer, torch.empty(1, 64, 4096, 4096)) == wanted


def test_parameters_are_those_that_train_each_once():
    network = nn.Sequential(nn.Linear(3, 4), nn.BatchNorm1d(4), nn.Linear(4, 2))
    assert count_parameters(network) == 16 + 8 + 10
    network[2].requires_grad_(False)
    assert count_parameters(network) == 16 + 8
    shared = nn.ModuleList([network[0], network[0]])
    assert count_parameters(shared) == 16
