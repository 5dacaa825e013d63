"""Template and search crops: square, around the target, filled with the mean colour outside.

The official code (pysot `get_subwindow`) pads the whole frame and then cuts; here only a canvas of
the crop's own size is built, with the same pixels.
"""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from nat2024.errors import ArrayContract
from nat2024.types import Image
from nat2024_trackers.siamese.state import Constants, FirstFrame, Target

LARGEST_CANVAS = 16384
"""Side in pixels up to which a crop is built in full, as the official code does."""

LARGEST_SIDE = 2**30
"""Side in pixels above which a start box is refused."""


@dataclass(frozen=True, slots=True)
class SearchWindow:
    """Part of the image that is searched.

    Attributes:
        side: of the square crop, in image pixels.
        scale: crop pixels a image pixel.
    """

    side: int
    scale: float


def context_side(target: Target, constants: Constants) -> float:
    """Side, not rounded, of the square that holds the target with its context."""
    context = constants.context_amount * (target.width + target.height)
    return math.sqrt((target.width + context) * (target.height + context))


def template_side(target: Target, constants: Constants) -> int:
    """Side of the template crop in image pixels, rounded half to even, at least 1.

    Raises:
        ArrayContract: the target is too large for any crop.
    """
    side = context_side(target, constants)
    if not side * constants.instance_size < LARGEST_SIDE * constants.exemplar_size:
        msg = f"start box of {target.width:g} x {target.height:g} pixels is too large to crop"
        raise ArrayContract(msg)
    return max(1, round(side))


def search_window(
    target: Target, first: FirstFrame, frame_size: tuple[int, int], constants: Constants
) -> SearchWindow:
    """Side and scale of the search crop; `frame_size` is (width, height)."""
    side = context_side(target, constants)
    share = constants.large_target_share
    if share is not None and target.width * target.height > share * frame_size[0] * frame_size[1]:
        side = float(first.template_side)
    enlarged = side * (constants.instance_size / constants.exemplar_size)
    return SearchWindow(max(1, round(enlarged)), constants.exemplar_size / side)


def mean_color(image: Image) -> npt.NDArray[np.uint8]:
    """uint8 (3,): mean of the image, truncated as in the official code."""
    import cv2

    # Sums of whole numbers are exact, so this is the mean that numpy takes 90 times as long for.
    sums = np.array(cv2.sumElems(image)[:3], dtype=np.float64)
    mean: npt.NDArray[np.float64] = sums / (image.shape[0] * image.shape[1])
    return mean.astype(np.uint8)


def crop(
    image: Image,
    target: Target,
    side: int,
    size: int,
    fill: npt.NDArray[np.uint8],
    out: Image | None = None,
) -> Image:
    """Cut a square around the target's centre and resize it to `size` (bilinear, uint8).

    Args:
        image: uint8 (H, W, 3); not modified, and never part of the result.
        target: its centre is the crop's centre.
        side: of the square in image pixels, at least 1; may reach beyond the image or miss it.
        size: of the result in pixels.
        fill: uint8 (3,), colour outside the image.
        out: uint8 (size, size, 3), C-contiguous, to write the result to.

    Returns:
        uint8 (size, size, 3): `out` where it is given.
    """
    import cv2

    out = np.empty((size, size, 3), dtype=np.uint8) if out is None else out
    left = _origin(target.center_x, side)
    top = _origin(target.center_y, side)
    if side > LARGEST_CANVAS:
        out[:] = _sampled_crop(image, (left, top), side, size, fill)
        return out
    patch = _square(image, left, top, side, fill)
    if side == size:
        np.copyto(out, patch)
    else:
        cv2.resize(patch, (size, size), dst=out, interpolation=cv2.INTER_LINEAR)
    return out


def _square(image: Image, left: int, top: int, side: int, fill: npt.NDArray[np.uint8]) -> Image:
    """The pixels of a square, part of the image where it lies within; filled where it does not."""
    import cv2

    height, width = image.shape[:2]
    x0, x1 = max(0, left), min(width, left + side)
    y0, y1 = max(0, top), min(height, top + side)
    if x0 >= x1 or y0 >= y1:
        nothing = np.empty((side, side, 3), dtype=np.uint8)
        nothing[:] = fill
        return nothing
    inside = image[y0:y1, x0:x1]
    margins = y0 - top, top + side - y1, x0 - left, left + side - x1
    if not any(margins):
        return inside
    kind = cv2.BORDER_CONSTANT | cv2.BORDER_ISOLATED
    filled: Image = cv2.copyMakeBorder(inside, *margins, kind, value=fill.tolist()).astype(
        np.uint8, copy=False
    )
    return filled


def _origin(center: float, side: int) -> int:
    return math.floor(center - (side + 1) / 2 + 0.5)


def _sampled_crop(
    image: Image, origin: tuple[int, int], side: int, size: int, fill: npt.NDArray[np.uint8]
) -> Image:
    """The resized crop without its canvas, for squares whose canvas would not fit in memory.

    Bilinear sampling touches two rows and columns for each result row and column; only these are
    gathered. Within one grey level of the canvas form.
    """
    height, width = image.shape[:2]
    near_x, far_x, weight_x = _samples(origin[0], side, size)
    near_y, far_y, weight_y = _samples(origin[1], side, size)

    def gather(
        rows: npt.NDArray[np.int64], columns: npt.NDArray[np.int64]
    ) -> npt.NDArray[np.float64]:
        inside = ((rows >= 0) & (rows < height))[:, None] & ((columns >= 0) & (columns < width))
        pixels = image[np.clip(rows, 0, height - 1)[:, None], np.clip(columns, 0, width - 1)]
        return np.where(inside[..., None], pixels, fill).astype(np.float64)

    across = weight_x[None, :, None]
    upper = gather(near_y, near_x) * (1 - across) + gather(near_y, far_x) * across
    lower = gather(far_y, near_x) * (1 - across) + gather(far_y, far_x) * across
    down = weight_y[:, None, None]
    return np.rint(upper * (1 - down) + lower * down).astype(np.uint8)


def _samples(
    origin: int, side: int, size: int
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64], npt.NDArray[np.float64]]:
    """Two image coordinates and the weight of the second for every result pixel of one axis."""
    position = np.clip((np.arange(size) + 0.5) * (side / size) - 0.5, 0, side - 1)
    near = np.floor(position).astype(np.int64)
    far = np.minimum(near + 1, side - 1)
    return near + origin, far + origin, position - near
