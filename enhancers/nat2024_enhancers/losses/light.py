"""Light distribution (LDEnhancer): the light branch gives the light of the image."""

import torch.nn.functional as F
from torch import Tensor


def light_distribution(estimated: Tensor, label: Tensor) -> Tensor:
    """Smooth L1 between O2 and the light label I_l, both (N, 3, H, W)."""
    return F.smooth_l1_loss(estimated, label)
