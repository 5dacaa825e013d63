"""The loss of DarkLighter without its perceptual term, and its start."""

from collections.abc import Mapping
from typing import Any

from torch import Tensor

from nat2024_enhancers.darklighter.model import DarkLighterNet
from nat2024_enhancers.darklighter.settings import DarkLighterSettings
from nat2024_enhancers.losses.centre import central_exposure, noise_size
from nat2024_enhancers.losses.colour import norm_differences
from nat2024_enhancers.losses.smoothness import total_variation


def loss_terms(
    network: DarkLighterNet, batch: Mapping[str, Any], settings: DarkLighterSettings
) -> dict[str, Tensor]:
    """The weighted terms of `image` (N, 3, 256, 256) in 0..1; their sum is the loss.

    Raises:
        ArrayContract: images are not 256x256.
    """
    enhanced, light, noise = network(batch["image"])
    return {
        "illumination": settings.smoothness * total_variation(light, factor=1.0),
        "exposure": settings.exposure * central_exposure(enhanced, level=settings.level),
        "colour": settings.colour * norm_differences(enhanced).mean(),
        "noise": settings.noise * noise_size(noise),
    }
