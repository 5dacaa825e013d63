"""What is SCT's own: windows of attention, folded normalisation, statistics, dropped branches."""

import pytest
import torch
import torch.nn.functional as F

from nat2024_enhancers.sct.attention import (
    NormedConvolution,
    from_windows,
    relative_positions,
    to_windows,
)
from nat2024_enhancers.sct.model import SCTNet


def test_relative_positions_are_those_of_a_window():
    index = relative_positions(4)
    assert index.dtype == torch.int64
    assert index[0, 0] == index[5, 5] == 24
    assert index[0, 1] == 23
    assert index[0, 4] == 24 - 7
    assert index[15, 0] == 48
    assert index[0, 15] == 0


def test_windows_are_cut_and_put_back():
    tokens = torch.arange(2 * 64 * 3, dtype=torch.float32).view(2, 64, 3)
    windows = to_windows(tokens, 8)
    assert torch.equal(windows[1, :, 0], tokens[0].view(8, 8, 3)[:4, 4:, 0].flatten())
    assert torch.equal(from_windows(windows, 8), tokens)


@pytest.mark.parametrize("kernel", [1, 3])
def test_folding_follows_weights_and_modes(kernel):
    torch.manual_seed(5)
    layer = NormedConvolution(8, kernel, 8 if kernel == 3 else 1, "running").eval()
    x = torch.randn(2, 8, 6, 6)
    for _ in range(2):
        with torch.no_grad():
            layer.conv[1].running_mean.normal_()
            layer.conv[1].weight.normal_()
            expected = F.gelu(layer.conv(x))
            torch.testing.assert_close(layer(x), expected, rtol=0, atol=1e-5)
    assert layer(x).requires_grad


def test_image_statistics_are_those_of_training_with_single_images(
    procedural_batch, procedural_network
):
    by_image = procedural_network(SCTNet(statistics="image"))
    trained = procedural_network(SCTNet())
    for layer in (trained.encoderlayer_0, trained.encoderlayer_1):
        layer.blocks[0].drop_path = 0.0
    trained.train()
    images = procedural_batch("sct.statistics", (2, 3, 40, 50))
    with torch.no_grad():
        single = torch.cat([trained(image[None]) for image in images])
        torch.testing.assert_close(by_image(images), single, rtol=1e-4, atol=1e-5)


def test_training_drops_branches_of_the_second_layer_only():
    network = SCTNet().train()
    first, second = network.encoderlayer_0.blocks[0], network.encoderlayer_1.blocks[0]
    ones = torch.ones(4000, 1, 1)
    assert torch.equal(first._drop(ones), ones)
    torch.manual_seed(6)
    dropped = second._drop(ones)
    assert dropped.unique().tolist() == pytest.approx([0.0, 1 / 0.9])
    assert dropped.mean().item() == pytest.approx(1.0, abs=0.03)
    network.eval()
    assert torch.equal(second._drop(ones), ones)
