"""Arrays of the renderer: single precision, since a video is many pixels."""

from typing import TypeAlias

import numpy as np
import numpy.typing as npt

Light: TypeAlias = npt.NDArray[np.float32]
"""float32 (H, W, 3) BGR, linear: twice the light is twice the number; or one channel of it."""

Colour: TypeAlias = npt.NDArray[np.float32]
"""float32 (3,) BGR."""

Points: TypeAlias = npt.NDArray[np.float64]
"""float64 (n, 2) or (n, 3): places in metres, or in pixels with the centre of the first at 0.5."""


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """A number between `low` and `high`, every factor equally likely."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def colour(*values: float) -> Colour:
    """A colour from its three parts, BGR."""
    return np.array(values, dtype=np.float32)


def smooth_noise(
    rng: np.random.Generator, size: tuple[int, int], scale: int
) -> npt.NDArray[np.float32]:
    """Noise of mean 0 and standard deviation about 1 that varies over `scale` pixels.

    Args:
        rng: where chance comes from.
        size: (width, height).
        scale: pixels from one random value to the next.
    """
    import cv2

    width, height = size
    coarse = rng.standard_normal((height // scale + 3, width // scale + 3), dtype=np.float32)
    fine = cv2.resize(coarse, None, fx=scale, fy=scale, interpolation=cv2.INTER_CUBIC)
    return np.asarray(fine[:height, :width], dtype=np.float32)
