"""What pictures of enhancement show: chosen images, what was stored of them, and where to zoom."""

from collections.abc import Sequence
from pathlib import Path
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from nat2024.datasets.video import VideoFrames
from nat2024.enhancing.pictures import read_picture
from nat2024.enhancing.running import find_video, frame_name
from nat2024.enhancing.sources import ImageItem, Item, Source
from nat2024.errors import FrameUnreadable, UsageError
from nat2024.types import Floats, Image, closest

Inset: TypeAlias = tuple[int, int, int, int]
"""x, y, w, h in pixels of the image."""

Chosen: TypeAlias = tuple[Item, int]
"""An item of the input, and which of its images."""

_INSET_SHARE = 0.22  # side of an inset by the shorter side of the image
_SMALLEST_INSET = 8
_DARK, _SATURATED = 0.05, 0.98
_DIM = 0.1
_LAMP = 0.4  # luma from which a pixel counts as lit by itself


def choose_images(source: Source, count: int) -> list[Chosen]:
    """At most `count` images of an input, evenly from its first to its last; 0 takes all."""
    every = [(item, index) for item in source.items for index in range(_length(item))]
    if not count or len(every) <= count:
        return every
    numbers = np.linspace(0, len(every) - 1, count).round().astype(int)
    return [every[number] for number in numbers]


def _length(item: Item) -> int:
    try:
        return len(item)
    except FrameUnreadable:
        return 0


def find_image(source: Source, name: str) -> Chosen:
    """The image of that name, as it lies in the input or by its file name alone.

    Raises:
        UsageError: there is none; names the closest.
    """
    titles = {item.title(i): (item, i) for item in source.items for i in range(_length(item))}
    if name in titles:
        return titles[name]
    for title, chosen in titles.items():
        if title.rpartition("/")[2] == name:
            return chosen
    msg = f"the input has no image {name!r}{closest(name, titles)}"
    raise UsageError(msg)


def read_stored(folder: Path, chosen: Chosen) -> Image | None:
    """What an enhancer made of an image, uint8 (H, W, 3) BGR; None where there is nothing."""
    item, index = chosen
    try:
        if isinstance(item, ImageItem):
            return read_picture(folder / item.target).image
        found = find_video(folder, item)
        if found is None:
            return None
        if found.is_dir():
            return read_picture(found / frame_name(index)).image
        return VideoFrames(found)[index]
    except FrameUnreadable:
        return None


def luma(image: Image) -> Floats:
    """Luma of a BGR image, float64 (H, W) in 0..1 (BT.601)."""
    weights = np.array([0.114, 0.587, 0.299]) / 255
    found: Floats = image.astype(np.float64) @ weights
    return found


def light_numbers(image: Image) -> dict[str, float]:
    """Mean and standard deviation of luma 0..1, and the shares of dark and saturated pixels."""
    light = luma(image)
    return {
        "mean": float(light.mean()),
        "deviation": float(light.std()),
        "dark_share": float((light < _DARK).mean()),
        "saturated_share": float((image.max(axis=2) >= 255 * _SATURATED).mean()),
    }


def thumbnail(image: Image, width: int, height: int) -> Image:
    """An image no larger than `width` x `height` with its sides in proportion, never enlarged."""
    import cv2

    scale = min(1.0, width / image.shape[1], height / image.shape[0])
    if scale == 1.0:
        return image
    size = (max(1, round(image.shape[1] * scale)), max(1, round(image.shape[0] * scale)))
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)


def check_inset(inset: Sequence[int], image: Image) -> Inset:
    """An inset as given, if it lies in the image; else `UsageError`."""
    x, y, w, h = inset
    height, width = image.shape[:2]
    if min(x, y) < 0 or min(w, h) < 1 or x + w > width or y + h > height:
        msg = f"inset {x},{y},{w},{h} does not lie in the {width}x{height} image"
        raise UsageError(msg)
    return x, y, w, h


def choose_insets(image: Image) -> tuple[Inset, ...]:
    """Where to look: the brightest lamp, and the dark place with the most detail.

    Always the same for the same image. Small or narrow images have one, or none.

    Args:
        image: uint8 (H, W, 3) BGR.

    Returns:
        The lamp first; the two do not overlap.
    """
    height, width = image.shape[:2]
    side = max(_SMALLEST_INSET, round(_INSET_SHARE * min(height, width)))
    w, h = min(width, side * 4 // 3), side
    if height < h or width < w:
        return ()
    light = luma(image)
    mean = _window_means(light, w, h)
    y, x = np.unravel_index(int(mean.argmax()), mean.shape)
    lamp = (int(x), int(y), w, h)
    contrast = _detail(light, mean, w, h)
    contrast[max(0, y - h + 1) : y + h, max(0, x - w + 1) : x + w] = -1
    if contrast.max() <= 0:
        return (lamp,)
    y, x = np.unravel_index(int(contrast.argmax()), contrast.shape)
    return lamp, (int(x), int(y), w, h)


def _detail(light: Floats, mean: Floats, w: int, h: int) -> Floats:
    """How much there is to see in each dark window: mean slope in stops; -1 where a lamp is in."""
    stops = np.log2(light + 1 / 32)  # noise in black counts little
    down = np.diff(stops, axis=0, append=stops[-1:])
    right = np.diff(stops, axis=1, append=stops[:, -1:])
    slope = _window_means(np.hypot(down, right), w, h)
    lamps = _window_means((light > _LAMP).astype(np.float64), w, h)
    dark = (mean <= max(np.quantile(mean, 0.6), _DIM)) & (lamps <= np.quantile(lamps, 0.3) + 1e-9)
    return np.where(dark, slope, -1.0)


def _window_means(values: Floats, w: int, h: int) -> Floats:
    """Mean of each window of `w` x `h`, by its top-left corner."""
    sums: npt.NDArray[np.float64] = np.pad(values, ((1, 0), (1, 0))).cumsum(0).cumsum(1)
    total = sums[h:, w:] - sums[:-h, w:] - sums[h:, :-w] + sums[:-h, :-w]
    means: Floats = total / (w * h)
    return means
