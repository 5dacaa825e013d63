"""How near an image comes to a reference: PSNR and SSIM on 8-bit images."""

import numpy as np

from nat2024.errors import ArrayContract
from nat2024.measures.pixels import check_image
from nat2024.types import Floats, Image

SSIM_WINDOW = 11
SSIM_SIGMA = 1.5
_PEAK = 255.0
_C1 = (0.01 * _PEAK) ** 2
_C2 = (0.03 * _PEAK) ** 2


def psnr(image: Image, reference: Image) -> float:
    """Peak signal-to-noise ratio in dB over all pixels and channels; infinite where equal.

    10 log10(255^2 / mean squared difference).

    Args:
        image: uint8 (H, W, 3).
        reference: of the same size and channel order.

    Raises:
        ArrayContract: one is no image, or their sizes differ.
    """
    check_pair(image, reference, "reference")
    difference = image.astype(np.float64) - reference
    error = float(np.mean(difference * difference))
    return float(10 * np.log10(_PEAK**2 / error)) if error > 0 else float("inf")


def ssim(image: Image, reference: Image) -> float:
    """Structural similarity, mean over places and channels; 1 where equal.

    The definition of its authors (Wang et al., "Image Quality Assessment: From Error Visibility to
    Structural Similarity", TIP 2004): a Gaussian window of 11x11 with sigma 1.5, K1 = 0.01,
    K2 = 0.03, dynamic range 255, at places where the whole window lies in the image. They take
    grey images; for colour it is taken for each channel and averaged.

    Args:
        image: uint8 (H, W, 3).
        reference: of the same size and channel order.

    Returns:
        NaN for images with a side below 11, where no window fits.

    Raises:
        ArrayContract: one is no image, or their sizes differ.
    """
    check_pair(image, reference, "reference")
    if min(image.shape[:2]) < SSIM_WINDOW:
        return float("nan")
    first, second = image.astype(np.float64), reference.astype(np.float64)
    mean_1, mean_2 = _window_mean(first), _window_mean(second)
    variance_1 = _window_mean(first * first) - mean_1 * mean_1
    variance_2 = _window_mean(second * second) - mean_2 * mean_2
    covariance = _window_mean(first * second) - mean_1 * mean_2
    above = (2 * mean_1 * mean_2 + _C1) * (2 * covariance + _C2)
    below = (mean_1 * mean_1 + mean_2 * mean_2 + _C1) * (variance_1 + variance_2 + _C2)
    return float(np.mean(above / below))


def check_pair(first: Image, second: Image, what: str) -> None:
    """Raise `ArrayContract` unless both are images of one size; `what` names the second."""
    check_image(first)
    check_image(second)
    if first.shape != second.shape:
        sizes = f"{second.shape[1]}x{second.shape[0]}, not {first.shape[1]}x{first.shape[0]}"
        msg = f"{what} and image differ in size: the {what} has {sizes}"
        raise ArrayContract(msg)


def _window_mean(values: Floats) -> Floats:
    """Gaussian mean of each channel around every place where the whole window fits."""
    import cv2

    kernel = cv2.getGaussianKernel(SSIM_WINDOW, SSIM_SIGMA, cv2.CV_64F)
    half = SSIM_WINDOW // 2
    means = cv2.sepFilter2D(values, cv2.CV_64F, kernel, kernel)
    return np.asarray(means[half:-half, half:-half], dtype=np.float64)
