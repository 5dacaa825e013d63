"""Exposure: the mean grey level of every region comes near to a wanted one."""

import torch
import torch.nn.functional as F
from torch import Tensor

_REGION = 16


def region_levels(image: Tensor, region: int = _REGION) -> Tensor:
    """Mean grey level of every region, (N, 1, H / region, W / region)."""
    return F.avg_pool2d(image.mean(dim=1, keepdim=True), region)


def exposure_smooth_l1(
    image: Tensor, *, level: float = 0.6, gain: float = 1.5, region: int = _REGION
) -> Tensor:
    """LDEnhancer's form: smooth L1 between `gain` times the regions' levels and `level`.

    The optimum is a level of `level / gain`, 0.4 with the official values.
    """
    levels = gain * region_levels(image, region)
    return F.smooth_l1_loss(levels, torch.full_like(levels, level))


def exposure_mse(image: Tensor, *, level: float = 0.6, region: int = _REGION) -> Tensor:
    """The form of Zero-DCE, DCE++ and HighlightNet: mean squared distance to `level`."""
    return (region_levels(image, region) - level).square().mean()
