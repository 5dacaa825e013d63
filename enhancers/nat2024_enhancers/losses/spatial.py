"""Spatial consistency (Guo et al., Zero-DCE, CVPR 2020): regions keep their contrast."""

import torch
import torch.nn.functional as F
from torch import Tensor

_REGION = 4


def spatial_map(enhanced: Tensor, reference: Tensor) -> Tensor:
    """Squared change of the contrast to the four neighbours, summed, for every 4x4 region.

    Beyond the border neighbours are black, as in the official code.

    Returns:
        (N, 1, H / 4, W / 4).
    """
    change = _pooled_grey(enhanced) - _pooled_grey(reference)
    around = F.pad(change, (1, 1, 1, 1))
    rows, columns = slice(1, -1), slice(1, -1)
    neighbours = (
        around[..., rows, :-2],
        around[..., rows, 2:],
        around[..., :-2, columns],
        around[..., 2:, columns],
    )
    return torch.stack([(change - other).square() for other in neighbours]).sum(dim=0)


def spatial_consistency(enhanced: Tensor, reference: Tensor) -> Tensor:
    """Mean of `spatial_map`."""
    return spatial_map(enhanced, reference).mean()


def _pooled_grey(image: Tensor) -> Tensor:
    return F.avg_pool2d(image.mean(dim=1, keepdim=True), _REGION)
