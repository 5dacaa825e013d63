"""Colour constancy: the three channels keep about the same level."""

import torch
from torch import Tensor

_LEAST = 1e-12


def channel_differences(image: Tensor, *, least: float = _LEAST) -> Tensor:
    """Root of the summed fourth powers of the differences of channel means, one an image.

    As in the official code of Zero-DCE and its successors; the paper has squares.

    Args:
        image: (N, 3, H, W).
        least: added under the root, whose gradient of a grey image is NaN otherwise.

    Returns:
        (N,).
    """
    red, green, blue = image.mean(dim=(2, 3)).unbind(dim=1)
    fourth = (red - green) ** 4 + (red - blue) ** 4 + (green - blue) ** 4
    return torch.sqrt(fourth + least)


def colour_constancy(image: Tensor, *, least: float = 0.0) -> Tensor:
    """Mean of `channel_differences`; official code has no `least`, training here has 1e-12."""
    return channel_differences(image, least=least).mean()


def norm_differences(image: Tensor) -> Tensor:
    """DarkLighter's form: squared differences of the channels' Frobenius norms, one an image.

    Returns:
        (N,).
    """
    pixels = image.shape[-2] * image.shape[-1]
    red, green, blue = torch.linalg.vector_norm(image, dim=(2, 3)).unbind(dim=1)
    squares: Tensor = (red - green) ** 2 + (red - blue) ** 2 + (blue - green) ** 2
    return squares / pixels
