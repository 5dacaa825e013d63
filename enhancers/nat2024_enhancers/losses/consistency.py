"""LLVE's loss (Zhang et al., CVPR 2021): moved or enhanced first, the result is the same."""

from collections.abc import Callable
from typing import NamedTuple

import torch
import torch.nn.functional as F
from torch import Tensor


class FlowTerms(NamedTuple):
    """The two terms without weights; the official sum is `image + 20 consistency`."""

    image: Tensor
    consistency: Tensor


def warp(image: Tensor, flow: Tensor) -> Tensor:
    """Move an image along a flow: bilinear, reflected at the borders.

    Args:
        image: (N, C, H, W).
        flow: (N, 2, H, W), pixels to the right and down, divided by (side - 1) / 2 as in the
            official code, whose sampling has the corners of border pixels at -1 and 1.
    """
    _, _, height, width = image.shape
    x = torch.linspace(-1, 1, width, device=image.device, dtype=image.dtype)
    y = torch.linspace(-1, 1, height, device=image.device, dtype=image.dtype)
    columns = x + flow[:, 0] / ((width - 1) / 2)
    rows = y[:, None] + flow[:, 1] / ((height - 1) / 2)
    grid = torch.stack([columns, rows], dim=-1)
    return F.grid_sample(image, grid, "bilinear", "reflection", align_corners=False)


def flow_consistency(
    network: Callable[[Tensor], Tensor], image: Tensor, target: Tensor, flow: Tensor
) -> FlowTerms:
    """L1 to the target, and L1 between enhanced-then-moved and moved-then-enhanced."""
    enhanced = network(image)
    again = network(warp(image, flow))
    return FlowTerms(F.l1_loss(enhanced, target), F.l1_loss(again, warp(enhanced, flow)))
