"""Smoothness of maps: squared differences of neighbouring values."""

from torch import Tensor


def total_variation(maps: Tensor, *, factor: float = 2.0) -> Tensor:
    """Squared vertical and horizontal differences, summed over channels, mean over pixels.

    Args:
        maps: (N, C, H, W); the sum over all C channels is taken, as the official codes do.
        factor: 2 in Zero-DCE, LDEnhancer (times 1000) and HighlightNet; 1 in DarkLighter.
    """
    count, _, height, width = maps.shape
    rows = (maps[..., 1:, :] - maps[..., :-1, :]).square().sum() / ((height - 1) * width)
    columns = (maps[..., 1:] - maps[..., :-1]).square().sum() / (height * (width - 1))
    return factor * (rows + columns) / count


def mean_total_variation(maps: Tensor) -> Tensor:
    """The same with a mean over channels as well, as RUAS takes it of its denoised image."""
    return total_variation(maps) / maps.shape[1]
