"""Correlation of search features with template features."""

import torch.nn.functional as F
from torch import Tensor


def depthwise_correlation(search: Tensor, kernel: Tensor) -> Tensor:
    """Correlate every channel of every sample with its own kernel.

    Args:
        search: (n, c, h, w).
        kernel: (n, c, p, q).

    Returns:
        (n, c, h - p + 1, w - q + 1).
    """
    count, channels = kernel.shape[:2]
    # Of channels-last maps PyTorch's CPU kernel takes up to ten times as long.
    search, kernel = search.contiguous(), kernel.contiguous()
    flat = search.reshape(1, count * channels, *search.shape[2:])
    filters = kernel.reshape(count * channels, 1, *kernel.shape[2:])
    result = F.conv2d(flat, filters, groups=count * channels)
    return result.reshape(count, channels, *result.shape[2:])
