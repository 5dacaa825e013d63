"""Running a network on bands of rows, so that its memory does not grow with the image."""

from collections.abc import Callable, Iterator

import torch
from torch import Tensor

BAND_PIXELS = 1 << 17
"""About how many pixels a band has: its features stay near the processor."""

_PIXELS_ELSEWHERE = 1 << 22
"""The same away from the CPU, where small bands leave a device idle."""


def bands_of(
    count: int,
    height: int,
    width: int,
    *,
    stride: int = 1,
    pixels: int | None = None,
    device: torch.device | None = None,
) -> Iterator[tuple[int, int]]:
    """First and last row (exclusive) of bands that cover `height` rows of `count` images.

    Bands begin at multiples of `stride` and have about `pixels` pixels: `BAND_PIXELS` by default,
    32 times as many where a `device` is named that is no CPU, as networks with few channels should.
    With gradients there is one band: training keeps the features of every band, so that bands
    would save nothing.
    """
    rows = height
    if pixels is None and device is not None and device.type != "cpu":
        pixels = _PIXELS_ELSEWHERE
    if not torch.is_grad_enabled():
        rows = max((pixels or BAND_PIXELS) // (count * width) // stride, 1) * stride
    for start in range(0, height, rows):
        yield start, min(start + rows, height)


def run_in_bands(
    network: Callable[[Tensor], Tensor],
    image: Tensor,
    *,
    halo: int,
    stride: int = 1,
    pixels: int | None = None,
) -> Tensor:
    """What `network` gives for the whole image, computed band by band.

    Args:
        network: keeps the size, and its answer at a row depends on at most `halo` rows above and
            below it and on nothing else of the image. Beyond the image it pads by itself.
        image: (N, C, H, W).
        halo: rows that the network sees above and below; a multiple of `stride`.
        stride: rows that the network handles as a unit, such as a window or a pooled pixel.
        pixels: about how many pixels a band has, `BAND_PIXELS` by default. Larger bands compute
            fewer rows of the halo twice, smaller ones stay nearer to the processor.
    """
    count, _, height, width = image.shape
    parts = []
    for start, stop in bands_of(count, height, width, stride=stride, pixels=pixels):
        above = max(start - halo, 0)
        band = network(image[..., above : stop + halo, :])
        parts.append(band[..., start - above : stop - above, :])
    return parts[0] if len(parts) == 1 else torch.cat(parts, dim=-2)
