"""Light labels by relative smoothness (Li and Brown, CVPR 2014): an image's light and its content.

The light I_l is smooth, the content I_o = I - I_l has few edges beside. Published code for night
images (Jin et al., ECCV 2022, `sept.m`) settles the level of the content by an update that need
not come to rest; the rule "excess" replaces it by one that has a single answer.
"""

from typing import Literal

import torch
from torch import Tensor

from nat2024_enhancers.ldenhancer.settings import LabelSettings

_FIRST_WEIGHT = 20.0  # 1 / 0.05, doubled with each pass
_TINY = 1e-16
_REPEATS = 500
_ACCURACY = 1e-10
_LEVEL_STEPS = 60
_COARSE = 4
_DEMO_CONTENT, _DEMO_LIGHT = 50.0, 25000.0


def light_labels(images: Tensor, settings: LabelSettings | None = None) -> tuple[Tensor, Tensor]:
    """The labels I_l and I_o of images.

    Args:
        images: float (N, C, H, W) in 0..1; each channel is separated with the others' edges.
        settings: how.

    Returns:
        Light and content, float32 of the same shape in 0..1.
    """
    how = settings or LabelSettings()
    # One by one, since a single image stays near the processor; exact in double precision.
    pairs = [_labels_of(_exact(image.unsqueeze(0)), how) for image in images]
    light, content = (torch.cat(labels) for labels in zip(*pairs, strict=True))
    return light, content


def _exact(image: Tensor) -> Tensor:
    """The image in double precision; levels of 8 bits as they were before rounding to single.

    Which edges are kept may hang on the last bit.
    """
    image = image.double()
    levels = (image * 255).round() / 255
    return torch.where((image - levels).abs() < 1e-7, levels, image)


def _labels_of(image: Tensor, how: LabelSettings) -> tuple[Tensor, Tensor]:
    if how.labels == "demo":
        content = separate(image, _DEMO_CONTENT, how.passes, how.rule)
        light = image - separate(image, _DEMO_LIGHT, how.passes, how.rule)
    else:
        content = separate(image, how.lam, how.passes, how.rule)
        light = image - content
    light, content = light * how.save_gain, content * how.save_gain
    return light.clamp(0, 1).float(), content.clamp(0, 1).float()


def separate(
    images: Tensor,
    lam: float = 500.0,
    passes: int = 3,
    rule: Literal["excess", "published"] = "excess",
) -> Tensor:
    """The content of images (N, C, H, W), 0 to the image itself; borders are periodic."""
    height, width = images.shape[-2:]
    smooth, edges = _responses(height, width, images)
    light_part = lam * smooth * torch.fft.rfft2(images)
    content, level = images, -images.mean(dim=(-2, -1), keepdim=True)
    for number in range(passes):
        weight = _FIRST_WEIGHT * 2**number
        kept = torch.fft.rfft2(_kept_edges(content, 1 / weight))
        spectrum = light_part.add(kept, alpha=weight).div_(lam * smooth + weight * edges + _TINY)
        spectrum[..., 0, 0] = 0  # it is rounding noise, and settled by what follows
        content = torch.fft.irfft2(spectrum, s=(height, width))
        if rule == "published":
            content = _published_level(content, images)
        else:
            upper = content - images
            # A sixteenth of the pixels shows about where it is.
            coarse = (..., slice(None, None, _COARSE), slice(None, None, _COARSE))
            level = _level(content[coarse], upper[coarse], level)
            level = _level(content, upper, level)
            content -= level
        content = torch.minimum(content.clamp_min_(0), images)
    return content


def _responses(height: int, width: int, like: Tensor) -> tuple[Tensor, Tensor]:
    """Squared responses of the Laplacian and of both differences at the frequencies of rfft2."""
    kind = {"dtype": torch.float64, "device": like.device}
    rows = 2 - 2 * torch.cos(2 * torch.pi * torch.fft.fftfreq(height, **kind))[:, None]
    columns = 2 - 2 * torch.cos(2 * torch.pi * torch.fft.rfftfreq(width, **kind))
    edges = rows + columns
    return edges.square().to(like.dtype), edges.to(like.dtype)


def _kept_edges(content: Tensor, least: float) -> Tensor:
    """The divergence of the gradients that are large enough over all channels together."""
    total = torch.zeros_like(content)
    for axis in (-1, -2):
        gradient = content.roll(-1, axis).sub_(content)
        gradient *= gradient.abs().sum(dim=1, keepdim=True) >= least
        total += gradient.roll(1, axis).sub_(gradient)
    return total


def _level(content: Tensor, upper: Tensor, start: Tensor) -> Tensor:
    """The t where what is below 0 and what is above the image, after taking t off, sum to 0.

    Newton's method from `start`, (N, C, 1, 1), kept between bounds: the sum falls in straight
    lines, so that it ends after a few steps. Where many t do, the smallest.

    Args:
        content: (N, C, H, W).
        upper: content less image.
        start: a guess.
    """
    low, high = upper.amin(dim=(-2, -1), keepdim=True), content.amax(dim=(-2, -1), keepdim=True)
    level = start.clamp(low, high)
    accuracy = max(_ACCURACY, 4 * torch.finfo(content.dtype).eps)
    for _ in range(_LEVEL_STEPS):
        under, over = (content - level).clamp_max_(0), (upper - level).clamp_min_(0)
        count = under.count_nonzero(dim=(-2, -1)) + over.count_nonzero(dim=(-2, -1))
        total = under.add_(over).sum(dim=(-2, -1), keepdim=True, dtype=torch.float64)
        low, high = torch.where(total > 0, level, low), torch.where(total < 0, level, high)
        moved = level + (total / count.clamp_min(1)[..., None, None]).to(level.dtype)
        moved = torch.where((moved < low) | (moved > high), (low + high) / 2, moved)
        step, level = (moved - level).abs().amax(), moved
        if step <= accuracy:
            break
    return torch.where(count[..., None, None] == 0, upper.amax(dim=(-2, -1), keepdim=True), level)


def _published_level(content: Tensor, image: Tensor) -> Tensor:
    pixels = image.shape[-2] * image.shape[-1]
    moving = torch.ones_like(content[..., :1, :1])
    for _ in range(_REPEATS):
        outside = (content < 0) | (content > image)
        change = 2 * (content * outside).sum(dim=(-2, -1), keepdim=True) / pixels
        content = content - change * moving
        moving = moving * (change.abs() >= 1 / pixels)
        if not moving.any():
            break
    return content
