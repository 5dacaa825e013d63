"""What is LLVE's own: rows of an enlarged image, and how fresh weights begin."""

import pytest
import torch
import torch.nn.functional as F

from nat2024_enhancers.llve.model import LLVENet, doubled_rows


@pytest.mark.parametrize("size", [(8, 5), (1, 3), (3, 1), (2, 2)])
def test_rows_of_the_enlarged_are_those_of_the_whole(size):
    x = torch.randn(2, 4, *size, generator=torch.Generator().manual_seed(1))
    height, width = 2 * size[0], 2 * size[1]
    whole = F.interpolate(x, (height, width), mode="bilinear", align_corners=True)
    for start in range(height):
        for stop in range(start + 1, height + 2):
            rows = doubled_rows(x, start, stop)
            torch.testing.assert_close(rows, whole[..., start:stop, :], rtol=0, atol=1e-6)


def test_fresh_weights_are_kaiming_normal_without_bias():
    net = LLVENet()
    assert all((p == 0).all() for name, p in net.named_parameters() if name.endswith("bias"))
    weight = net.down4.maxpool_conv[1].double_conv[0].weight
    assert weight.std().item() == pytest.approx((2 / (9 * 256)) ** 0.5, rel=0.01)
