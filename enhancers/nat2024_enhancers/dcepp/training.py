"""The loss of DCE++ (Zero-DCE++)."""

from collections.abc import Mapping
from typing import Any

from torch import Tensor

from nat2024_enhancers.dcepp.model import DCEppNet
from nat2024_enhancers.dcepp.settings import DCEppSettings
from nat2024_enhancers.losses.colour import colour_constancy
from nat2024_enhancers.losses.exposure import exposure_mse
from nat2024_enhancers.losses.smoothness import total_variation
from nat2024_enhancers.losses.spatial import spatial_consistency


def loss_terms(
    network: DCEppNet, batch: Mapping[str, Any], settings: DCEppSettings
) -> dict[str, Tensor]:
    """The weighted terms of `image` (N, 3, H, W) in 0..1; their sum is the loss."""
    image, used = batch["image"], network.scale_factor
    network.scale_factor = settings.training_scale
    try:
        enhanced, curve = network(image)
    finally:
        network.scale_factor = used
    colour = colour_constancy(enhanced, least=settings.colour_least)
    exposure = exposure_mse(enhanced, level=settings.level, region=settings.region)
    return {
        "smoothness": settings.smoothness * total_variation(curve),
        "spatial": settings.spatial * spatial_consistency(enhanced, image),
        "colour": settings.colour * colour,
        "exposure": settings.exposure * exposure,
    }
