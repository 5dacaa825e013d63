"""DarkLighter's own terms: exposure that counts more in the centre, and the size of the noise."""

import math

import torch
import torch.nn.functional as F
from torch import Tensor

from nat2024.errors import ArrayContract
from nat2024_enhancers.losses.exposure import region_levels

_SIDE = 256
_GRID = 16


def centre_weights(like: Tensor | None = None) -> Tensor:
    """The 16x16 weights of 256x256 images: smallest in the corners, largest in the centre.

    Official code differs: the paper has one weight, ln(e + distance to the border).
    """
    half = torch.arange(_GRID // 2, dtype=torch.float32)
    distance = torch.cat([half, half.flip(0)])
    radius = torch.sqrt(distance[:, None] ** 2 + distance[None] ** 2)
    weights = torch.log(math.e + radius)
    return weights if like is None else weights.to(like)


def central_exposure(image: Tensor, *, level: float = 0.6) -> Tensor:
    """Mean squared, weighted distance of the regions' levels to `level`.

    Raises:
        ArrayContract: images are not 256x256, for which the weights are defined.
    """
    if image.shape[-2:] != (_SIDE, _SIDE):
        height, width = image.shape[-2:]
        msg = f"DarkLighter's exposure loss takes {_SIDE}x{_SIDE} images, not {width}x{height}"
        raise ArrayContract(msg)
    levels = region_levels(image, _GRID)
    return ((levels - level) * centre_weights(levels)).square().mean()


def noise_size(noise: Tensor) -> Tensor:
    """Squared Frobenius norm of every noise map (a sum over pixels), mean over images and maps."""
    return F.mse_loss(noise, torch.zeros_like(noise)) * (noise.shape[-2] * noise.shape[-1])
