"""What a camera does to a pair of crops: blur, lost resolution, night, noise, JPEG, grey."""

from dataclasses import dataclass
from functools import cache

import cv2
import numpy as np
import numpy.typing as npt

from nat2024.types import Image
from nat2024_trackers.siamrpnpp.training.geometry import Rng


@dataclass(frozen=True, slots=True)
class Exposure:
    """Tone curve and noise of one crop, of grey levels 0..255.

    Attributes:
        gamma: power of the tone curve.
        gain: float32 (3,), factor of each channel.
        black: grey levels added.
        noise: standard deviation.
        reduction: factor by which resolution is lost.
    """

    gamma: float
    gain: npt.NDArray[np.float32]
    black: float
    noise: float
    reduction: float


def expose_pair(rng: Rng, template: Image, search: Image) -> tuple[Image, Image]:
    """Both crops as one camera might have taken them, shortly after each other."""
    search = _bordered(rng, search)
    crops = [_blurred(rng, template), _blurred(rng, search)]
    is_night = rng.random() < 0.4
    first = _draw_exposure(rng, is_night=is_night)
    second = _varied(rng, first)
    if is_night and rng.random() < 0.4:
        crops = [_glowing(rng, crop) if rng.random() < 0.7 else crop for crop in crops]
    exposed = [_expose(rng, c, e) for c, e in zip(crops, (first, second), strict=True)]
    if rng.random() < 0.6:
        quality = int(rng.integers(35, 96))
        exposed = [_compressed(crop, quality) for crop in exposed]
    sides = (template.shape[0], search.shape[0])
    enlarged = [_resized(crop, side) for crop, side in zip(exposed, sides, strict=True)]
    if rng.random() < 0.12:
        enlarged = [_grey(crop) for crop in enlarged]
    return enlarged[0], enlarged[1]


def vary_pair(rng: Rng, template: Image, search: Image) -> tuple[Image, Image]:
    """Milder changes, for crops of frames that a camera (or its model) has already taken."""
    gamma = float(np.exp(rng.uniform(-0.4, 0.4)))
    gain = np.exp(rng.uniform(-0.4, 0.4)) * rng.uniform(0.9, 1.1, size=3)
    first = Exposure(gamma, gain.astype(np.float32), 0.0, 0.0, 1.0)
    second = _varied(rng, first)
    if rng.random() < 0.15:
        search = _blurred(rng, search)
    pair = [_expose(rng, template, first), _expose(rng, _bordered(rng, search), second)]
    if rng.random() < 0.12:
        pair = [_grey(crop) for crop in pair]
    return pair[0], pair[1]


def _draw_exposure(rng: Rng, *, is_night: bool) -> Exposure:
    # targets of 15 to 30 pixels look like that at the scale of a template
    reduction = float(rng.uniform(1, 1.5) if rng.random() < 0.5 else rng.uniform(1.5, 5))
    if is_night:
        gain = rng.uniform(0.15, 0.8) * rng.uniform(0.8, 1.2, size=3)
        gamma, black, noise = rng.uniform(1, 2.2), rng.uniform(0, 12), abs(rng.normal(0, 6))
    else:
        gain = np.exp(rng.uniform(-0.4, 0.3)) * rng.uniform(0.9, 1.1, size=3)
        gamma, black, noise = np.exp(rng.uniform(-0.3, 0.3)), 0.0, abs(rng.normal(0, 3))
    return Exposure(float(gamma), gain.astype(np.float32), float(black), float(noise), reduction)


def _varied(rng: Rng, exposure: Exposure) -> Exposure:
    """Somewhat later; sometimes far into the dark, or out of it."""
    reach = 0.8 if rng.random() < 0.2 else 0.25
    return Exposure(
        exposure.gamma * float(np.exp(rng.uniform(-0.15, 0.15))),
        exposure.gain * np.float32(np.exp(rng.uniform(-reach, reach))),
        exposure.black,
        exposure.noise * float(np.exp(rng.uniform(-0.3, 0.3))),
        exposure.reduction,
    )


def _expose(rng: Rng, crop: Image, exposure: Exposure) -> Image:
    side = max(16, round(crop.shape[0] / exposure.reduction))
    if side < crop.shape[0]:
        crop = np.asarray(cv2.resize(crop, (side, side), interpolation=cv2.INTER_AREA))
    levels = (np.arange(256, dtype=np.float32) / 255) ** np.float32(exposure.gamma) * 255
    table = levels[:, None] * exposure.gain + np.float32(exposure.black)
    pixels = np.asarray(cv2.LUT(crop, table[None].astype(np.float32)), dtype=np.float32)
    if exposure.noise > 0.5:
        pixels += _noise(rng, crop.shape[0]) * np.float32(exposure.noise)
    return np.clip(pixels, 0, 255).astype(np.uint8)


@cache
def _noise_field() -> npt.NDArray[np.float32]:
    """Noise that pairs take pieces of, float32 (512, 512, 3): drawing it anew takes longest."""
    return np.random.default_rng(55).standard_normal((512, 512, 3), dtype=np.float32)


def _noise(rng: Rng, side: int) -> npt.NDArray[np.float32]:
    """A square piece of noise of standard deviation 1, float32 (side, side, 3)."""
    field = _noise_field()
    y, x = rng.integers(0, len(field) - side + 1, size=2).tolist()
    sign = np.float32(rng.choice([-1, 1]))
    return field[y : y + side, x : x + side] * sign


def _bordered(rng: Rng, crop: Image) -> Image:
    """Sometimes a strip in the mean colour, as at the edge of a frame."""
    if rng.random() >= 0.06:
        return crop
    strip = max(1, int(crop.shape[0] * rng.uniform(0.05, 0.35)))
    turns = int(rng.integers(4))
    bordered = np.rot90(crop, turns).copy()
    bordered[:strip] = crop.mean(axis=(0, 1)).astype(np.uint8)
    return np.ascontiguousarray(np.rot90(bordered, -turns))


def _blurred(rng: Rng, crop: Image) -> Image:
    """Sometimes motion blur of 3 to 11 pixels at any angle."""
    if rng.random() >= 0.22:
        return crop
    length = int(rng.choice([3, 5, 7, 9, 11]))
    kernel = np.zeros((length, length), dtype=np.float32)
    kernel[length // 2] = 1
    middle = ((length - 1) / 2, (length - 1) / 2)
    turn = cv2.getRotationMatrix2D(middle, float(rng.uniform(0, 180)), 1.0)
    turned = np.asarray(cv2.warpAffine(kernel, turn, (length, length)))
    return np.asarray(cv2.filter2D(crop, -1, turned / turned.sum()), dtype=np.uint8)


def _glowing(rng: Rng, crop: Image) -> Image:
    """The halo of a lamp somewhere in the crop."""
    side = crop.shape[0]
    x, y = rng.uniform(0, side, size=2)
    radius, strength = float(rng.uniform(20, 80)), float(rng.uniform(60, 200))
    tint = rng.uniform(0.4, 1.0, size=3).astype(np.float32)
    across = np.exp(-(((np.arange(side) - x) / radius) ** 2)).astype(np.float32)
    down = np.exp(-(((np.arange(side) - y) / radius) ** 2)).astype(np.float32)
    halo = np.outer(down, across)[..., None] * tint * np.float32(strength)
    return np.clip(crop + halo, 0, 255).astype(np.uint8)


def _compressed(crop: Image, quality: int) -> Image:
    _, data = cv2.imencode(".jpg", crop, [cv2.IMWRITE_JPEG_QUALITY, quality])
    return np.asarray(cv2.imdecode(data, cv2.IMREAD_COLOR), dtype=np.uint8)


def _resized(crop: Image, side: int) -> Image:
    if crop.shape[0] == side:
        return crop
    return np.asarray(cv2.resize(crop, (side, side)), dtype=np.uint8)


def _grey(crop: Image) -> Image:
    return np.asarray(cv2.cvtColor(cv2.cvtColor(crop, cv2.COLOR_BGR2GRAY), cv2.COLOR_GRAY2BGR))
