"""The loss of HighlightNet."""

from collections.abc import Mapping
from typing import Any

from torch import Tensor

from nat2024_enhancers.highlightnet.model import HighlightNet
from nat2024_enhancers.highlightnet.settings import HighlightNetSettings
from nat2024_enhancers.losses.exposure import exposure_mse
from nat2024_enhancers.losses.smoothness import total_variation
from nat2024_enhancers.losses.spatial import spatial_consistency


def loss_terms(
    network: HighlightNet, batch: Mapping[str, Any], settings: HighlightNetSettings
) -> dict[str, Tensor]:
    """The weighted terms of `image` (N, 3, H, W) in 0..1; their sum is the loss."""
    image = batch["image"]
    enhanced, mask, dark = network(image)
    exposure = exposure_mse(enhanced, level=settings.level, region=settings.region)
    darkness = exposure_mse(dark, level=0.0, region=settings.region)
    return {
        "smoothness": settings.smoothness * total_variation(mask),
        "spatial": settings.spatial * spatial_consistency(enhanced, image),
        "exposure": settings.exposure * exposure,
        "darkness": settings.darkness * darkness,
    }
