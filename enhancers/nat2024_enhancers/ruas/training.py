"""The losses of RUAS: of its illumination cells, and of its denoiser."""

from collections.abc import Mapping
from typing import Any

import torch.nn.functional as F
from torch import Tensor

from nat2024_enhancers.losses.ruas import denoising_loss, illumination_smoothness
from nat2024_enhancers.ruas.model import RUASNet
from nat2024_enhancers.ruas.settings import RUASSettings


def loss_terms(
    network: RUASNet, batch: Mapping[str, Any], settings: RUASSettings
) -> dict[str, Tensor]:
    """The weighted terms of `image` (N, 3, H, W) in 0..1; their sum is the loss.

    The denoiser sees the last stage's image as a constant, as in the official code.
    """
    image = batch["image"]
    maps = network.enhance_net.maps(image)
    light, noisy = maps["t3"], maps["u3"].detach()
    smoothness = illumination_smoothness(image, light, fixed=settings.smooth_fixed)
    denoising = denoising_loss(network.denoise_net(noisy), noisy)
    return {
        "fidelity": settings.fidelity * F.mse_loss(light, image),
        "smoothness": settings.smoothness * smoothness,
        "denoising": settings.denoising * denoising,
    }
