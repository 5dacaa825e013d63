"""How an image is fed to an enhancer: as its authors' own test does, or as trackers do."""

from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from nat2024.errors import ArrayContract
from nat2024.images import check_image, image_to_batch
from nat2024.interfaces import Enhancer, enhance_frame
from nat2024.types import Image

if TYPE_CHECKING:
    import torch

Feed: TypeAlias = Literal["image", "tracker"]
"""`image`: colours as the authors' stand-alone test feeds them; `tracker`: BGR frames."""


def enhance(enhancer: Enhancer, image: Image, feed: Feed) -> Image:
    """Enhance uint8 (H, W, 3) BGR to the same, and hold the enhancer to its contract.

    Raises:
        ArrayContract: what came out is no image, or of another size.
    """
    if feed == "tracker":
        enhanced = enhance_frame(enhancer, image, enhancer.device)
    else:
        enhanced = enhancer.enhance(image, bgr=True)
    check_image(enhanced, f"what {enhancer.name or 'the enhancer'} gives")
    if enhanced.shape != image.shape:
        msg = f"{enhancer.name} turned an image of {image.shape} into {enhanced.shape}"
        raise ArrayContract(msg)
    return enhanced


def enhance_unrounded(enhancer: Enhancer, image: Image, feed: Feed) -> npt.NDArray[np.float32]:
    """As `enhance`, but float32 (H, W, 3) BGR in 0..1 before it is rounded to 8 bits.

    For enhancers that work on batches; one that works on 8-bit images gives rounded values.
    """
    reverse = _reverses(enhancer, feed, in_batches=True)
    batch = enhancer.enhance_batch(image_to_batch(image, enhancer.device, reverse=reverse))
    array: npt.NDArray[np.float32] = batch[0].permute(1, 2, 0).cpu().numpy()
    return np.ascontiguousarray(array[..., ::-1] if reverse else array)


def _reverses(enhancer: Enhancer, feed: Feed, *, in_batches: bool) -> bool:
    """Whether a BGR image is turned into RGB before it becomes a batch."""
    turns = in_batches and getattr(enhancer, "channel_order", "as_given") == "rgb"
    if feed == "tracker":
        return False
    return (getattr(enhancer, "image_order", "rgb") == "rgb") != turns


def compute_maps(
    enhancer: Enhancer, image: Image, feed: Feed
) -> tuple[dict[str, npt.NDArray[np.float32]], str]:
    """The maps of one image, uint8 (H, W, 3) BGR, by name.

    Returns:
        float32 (channels, h, w) each, cut to the image where they have its padded size, and
        (channels, 1, 1) for numbers of the whole image; and the order of the colours that the
        network saw, "RGB" or "BGR".
    """
    reverse = _reverses(enhancer, feed, in_batches=False)
    if feed == "tracker" and getattr(enhancer, "channel_order", "as_given") == "rgb":
        reverse = True
    batch = image_to_batch(image, enhancer.device, reverse=reverse)
    maps = enhancer.maps(batch)
    pad: Any = getattr(enhancer, "pad", None)
    padded, top, left = pad(batch) if pad and maps else (batch, 0, 0)
    return (
        {name: _cut(values, image, padded, top, left) for name, values in maps.items()},
        "RGB" if reverse else "BGR",
    )


def _cut(
    values: "torch.Tensor", image: Image, padded: "torch.Tensor", top: int, left: int
) -> npt.NDArray[np.float32]:
    array: npt.NDArray[np.float32] = values[0].float().cpu().numpy()
    if array.ndim < 2:
        return array.reshape(-1, 1, 1)
    array = array.reshape(-1, *array.shape[-2:])
    if array.shape[-2:] == padded.shape[-2:]:
        height, width = image.shape[:2]
        array = array[..., top : top + height, left : left + width]
    return np.ascontiguousarray(array)
