"""Which part of a frame a picture shows, and cutting it out."""

from collections.abc import Iterable

import numpy as np

from nat2024.types import Box, Boxes, Image

SIDES = 5.0
"""Width of a view over the size of its target, where nothing else is asked for."""

_LEAST = 12.0  # width of a view over that of a box of one pixel, so that noise is not magnified
_MARGIN = 1.15  # room around boxes that are included


def choose_view(
    frame_size: tuple[int, int],
    target: Box | None,
    others: Iterable[Box] = (),
    *,
    aspect: float = 4 / 3,
    sides: float = SIDES,
) -> Box:
    """A region around a target that takes in other boxes, as long as it grows to the double only.

    Args:
        frame_size: (width, height) of the frame in pixels.
        target: x, y, w, h; None, or not finite, gives the middle of the frame.
        others: boxes that are taken in where they are near.
        aspect: width over height of the region.
        sides: width of the region over the size of the target.

    Returns:
        x, y, w, h inside the frame. It has the aspect unless the frame itself is too small.
    """
    size = np.array(frame_size, dtype=np.float64)
    whole = np.array([0.0, 0.0, *size])
    if target is None or not np.isfinite(target).all() or (target[2:] <= 0).any():
        return _fitted(size / 2, _widest(size, aspect), aspect, size)
    centre = target[:2] + target[2:] / 2
    if (centre < 0).any() or (centre > size).any():
        return _fitted(np.clip(centre, 0, size), _widest(size, aspect) / 2, aspect, size)
    wanted = max(sides * float(np.sqrt(target[2] * target[3])), _LEAST * sides)
    width = max(wanted, _MARGIN * float(target[2]), _MARGIN * aspect * float(target[3]))
    reach = width
    for box in others:
        if not np.isfinite(box).all():
            continue
        far = np.maximum(np.abs(box[:2] - centre), np.abs(box[:2] + box[2:] - centre))
        needed = 2 * _MARGIN * max(float(far[0]), aspect * float(far[1]))
        if needed <= 2 * width:
            reach = max(reach, needed)
    found = _fitted(centre, min(reach, _widest(size, aspect)), aspect, size)
    return found if (found[2:] <= whole[2:] + 1e-6).all() else whole


def _widest(size: Boxes, aspect: float) -> float:
    return float(min(size[0], size[1] * aspect))


def _fitted(centre: Boxes, width: float, aspect: float, size: Boxes) -> Box:
    sides = np.array([width, width / aspect])
    corner = np.clip(centre - sides / 2, 0, np.maximum(0, size - sides))
    return np.concatenate([corner, sides])


def cut_view(image: Image, view: Box, size: tuple[int, int]) -> Image:
    """The part of a frame in a view, resampled to `size` (width, height).

    Args:
        image: uint8 (H, W, 3).
        view: x, y, w, h inside the frame, fractions of pixels allowed.
        size: of what is made.
    """
    import cv2

    scale = np.array(size) / view[2:]
    if scale.min() < 1:  # averaged over areas first, so that fine lines do not break
        left, top = np.floor(view[:2]).astype(int)
        right, bottom = np.ceil(view[:2] + view[2:]).astype(int)
        part = np.ascontiguousarray(image[top:bottom, left:right])
        whole = np.maximum(1, np.round(np.array(part.shape[1::-1]) * scale)).astype(int)
        part = np.asarray(cv2.resize(part, whole.tolist(), interpolation=cv2.INTER_AREA))
        return _shifted(part, (view[:2] - (left, top)) * scale, np.ones(2), size)
    return _shifted(image, view[:2] * scale, scale, size)


def _shifted(image: Image, corner: Boxes, scale: Boxes, size: tuple[int, int]) -> Image:
    import cv2

    # OpenCV counts from the middle of the first pixel, boxes from its edge
    shift = (scale - 1) / 2 - corner
    warp = np.array([[scale[0], 0, shift[0]], [0, scale[1], shift[1]]])
    view = cv2.warpAffine(
        image, warp, size, flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
    )
    return np.asarray(view, dtype=np.uint8)


def place_box(box: Box, view: Box, size: tuple[int, int]) -> Box:
    """A box of the frame in pixels of the picture that `cut_view` makes of a view."""
    scale = np.array(size) / view[2:]
    placed: Box = (box - np.array([*view[:2], 0, 0])) * np.tile(scale, 2)
    return placed
