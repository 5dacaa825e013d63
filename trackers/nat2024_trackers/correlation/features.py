"""What the filters see of a patch: a stack of maps, one value for each cell."""

import numpy as np

from nat2024_trackers.correlation.fhog import FHOG, Array
from nat2024_trackers.correlation.samples import Pixels

_GREY = np.array([0.114, 0.587, 0.299], dtype=np.float32)
"""Weights of blue, green and red, ITU-R BT.601."""


def gradient_maps(patch: Pixels, hog: FHOG) -> Array:
    """Histograms of gradients, float32 (31, rows, columns)."""
    maps: Array = hog(patch[None].astype(np.float32, copy=False))[0]
    return maps


def color_maps(patch: Pixels, hog: FHOG) -> Array:
    """Mean colour of every cell, less that of the patch: float32 (3, rows, columns) in -1..1."""
    import cv2

    means = cv2.resize(
        patch.astype(np.float32, copy=False), (hog.columns, hog.rows), interpolation=cv2.INTER_AREA
    )
    maps: Array = (means - means.mean(axis=(0, 1))).transpose(2, 0, 1) / np.float32(255)
    return maps


def log_grey(patch: Pixels) -> Array:
    """Logarithm of the grey patch with mean 0 and norm 1, float32 (height, width).

    An even patch gives zeros.
    """
    grey = np.log1p(patch.astype(np.float32, copy=False) @ _GREY)
    grey = grey - grey.mean()
    norm = float(np.linalg.norm(grey))
    # Rounding alone leaves a pattern in an even patch; what is below a grey level's trace is none.
    answer: Array = grey / np.float32(norm) if norm > 1e-3 else np.zeros_like(grey)
    return answer
