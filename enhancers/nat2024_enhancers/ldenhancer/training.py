"""The loss of LDEnhancer (section III of the paper) and its start."""

from collections.abc import Mapping
from typing import Any

import torch
from torch import Tensor, nn

from nat2024_enhancers.ldenhancer.model import STRIDE, LDEnhancerNet
from nat2024_enhancers.ldenhancer.settings import LDEnhancerSettings
from nat2024_enhancers.losses.colour import colour_constancy
from nat2024_enhancers.losses.exposure import exposure_smooth_l1
from nat2024_enhancers.losses.light import light_distribution
from nat2024_enhancers.losses.smoothness import total_variation
from nat2024_enhancers.losses.spatial import spatial_consistency


def loss_terms(
    network: LDEnhancerNet,
    batch: Mapping[str, Any],
    settings: LDEnhancerSettings,
    *,
    light_loss: bool = True,
) -> dict[str, Tensor]:
    """The weighted terms; their sum is the loss.

    Args:
        network: in training mode.
        batch: `image`, and with a light loss `light` (I_l) and `content` (I_o), all (N, 3, H, W)
            in 0..1; `place` where they are crops, row and column in pixels.
        settings: the weights.
        light_loss: whether there are labels; without, the contrast of the image itself is kept.
    """
    image = batch["image"]
    row, column = batch.get("place", (0, 0))
    enhanced, light, amount = network(image, (row // STRIDE, column // STRIDE))
    wanted = batch["content"] if light_loss else image
    colour = colour_constancy(enhanced, least=settings.colour_least)
    exposure = exposure_smooth_l1(
        enhanced, level=settings.level, gain=settings.gain, region=settings.region
    )
    terms = {
        "spatial": settings.spatial * spatial_consistency(enhanced, wanted),
        "colour": settings.colour * colour,
        "smoothness": settings.smoothness * total_variation(amount),
        "exposure": settings.exposure * exposure,
    }
    if light_loss:
        terms["light"] = settings.light * light_distribution(light, batch["light"])
    return terms


def prepare_network(network: LDEnhancerNet, settings: LDEnhancerSettings) -> None:
    """Set the dropout, and scale fresh weights: the last layers and the position tables."""
    nets = [network.content_estimation]
    if network.two_branch:
        nets.append(network.light_estimation)
    with torch.no_grad():
        for net in nets:
            for weight in net.e_conv5.parameters():
                weight.mul_(settings.last_layer_scale)
        if network.cross_attention:
            for table in (network.CrossAttention.row_embed, network.CrossAttention.col_embed):
                table.weight.mul_(settings.position_scale)
    for module in network.modules():
        if isinstance(module, nn.Dropout):
            module.p = settings.dropout
        elif isinstance(module, nn.MultiheadAttention):
            module.dropout = settings.dropout
