"""The losses of RUAS (Liu et al., CVPR 2021): of the illumination, and of the denoised image."""

import torch
import torch.nn.functional as F
from torch import Tensor

from nat2024_enhancers.losses.smoothness import mean_total_variation

_OFFSETS = (
    *((1, 0), (0, 1), (1, 1), (1, -1), (2, 0), (0, 2)),
    *((2, 1), (2, -1), (1, 2), (1, -2), (2, 2), (2, -2)),
)
_SIGMA = 0.1
_YCBCR = ((0.257, 0.564, 0.098), (-0.148, -0.291, 0.439), (0.439, -0.368, -0.071))
_YCBCR_OFFSET = (16 / 255, 128 / 255, 128 / 255)


def illumination_loss(image: Tensor, light: Tensor, *, fixed: bool = False) -> Tensor:
    """Half the mean squared distance of the illumination to the image, plus its smoothness.

    Args:
        image: y, (1, 3, H, W); any number of images with `fixed`.
        light: t of the last stage, of the same shape.
        fixed: see `illumination_smoothness`.
    """
    smoothness = illumination_smoothness(image, light, fixed=fixed)
    return 0.5 * F.mse_loss(light, image) + smoothness


def illumination_smoothness(image: Tensor, light: Tensor, *, fixed: bool = False) -> Tensor:
    """Differences of the illumination to 24 neighbours, weighted by the image's likeness there.

    Args:
        image: y, (1, 3, H, W).
        light: t, of the same shape.
        fixed: the official code converts colours of scrambled triplets (it reads channel-first
            memory as channel-last) and gets the exponent's factor wrong, -0.005 in place of -50;
            True does what was meant.
    """
    colours = _to_ycbcr(image, scrambled=not fixed)
    factor = -1 / (2 * _SIGMA**2) if fixed else -0.5 * _SIGMA**2
    total = light.new_zeros(())
    for rows, columns in _OFFSETS:
        first, second = _shifted(colours, rows, columns)
        weight = torch.exp(factor * (first - second).square().sum(dim=1, keepdim=True))
        near, far = _shifted(light, rows, columns)
        # Each neighbour is met from both sides; the code takes the product of means.
        total = total + 2 * weight.mean() * (near - far).abs().mean()
    return total


def denoising_loss(denoised: Tensor, image: Tensor) -> Tensor:
    """1e-7 of the mean squared change, plus the total variation."""
    return 1e-7 * F.mse_loss(denoised, image) + mean_total_variation(denoised)


def _to_ycbcr(image: Tensor, *, scrambled: bool) -> Tensor:
    matrix, offset = image.new_tensor(_YCBCR), image.new_tensor(_YCBCR_OFFSET)
    if scrambled:
        return (image.reshape(-1, 3) @ matrix.T + offset).reshape(image.shape)
    return (image.movedim(1, -1) @ matrix.T + offset).movedim(-1, 1)


def _shifted(maps: Tensor, rows: int, columns: int) -> tuple[Tensor, Tensor]:
    """Values and their neighbours so many rows below and columns to the right."""
    height, width = maps.shape[-2:]
    left, right = max(-columns, 0), max(columns, 0)
    near = maps[..., : height - rows, left : width - right]
    far = maps[..., rows:, right : width - left]
    return near, far
