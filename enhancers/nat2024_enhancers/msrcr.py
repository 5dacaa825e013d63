"""Multi-scale retinex with colour restoration."""

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from nat2024.cards import Card
from nat2024.errors import InvalidOption
from nat2024.images import check_batch
from nat2024.interfaces import Enhancer
from nat2024.registry import register_enhancer

if TYPE_CHECKING:
    import torch

_SCALES = (15.0, 80.0, 250.0)
_SHARP_ENOUGH = 8.0  # a Gaussian of this many pixels loses nothing at half the size
_FLAT = 1e-3  # a retinex that varies less is rounding noise of a flat image


@register_enhancer("msrcr")
class Msrcr(Enhancer):
    """Divides an image by its surroundings at three scales and restores its colours.

    With values I of 1..256, the retinex of a channel is the mean over three Gaussian surroundings
    of log I - log (surroundings), times log(alpha I / (R + G + B)), which gives back colours that
    the retinex greys. Between `clip` percent from below and above, it is stretched to 0..1.
    The scales are 15, 80 and 250 pixels with equal weights, and alpha is 125, as published.
    """

    card = Card(
        title="MSRCR",
        summary="Divides an image by its surroundings at three scales and restores its colours.",
        paper="D. J. Jobson, Z. Rahman, G. A. Woodell: A Multiscale Retinex for Bridging the Gap "
        "Between Color Images and the Human Observation of Scenes. TIP 6(7), 1997",
        colour_order="any",
        size_rule="any size; scales are in pixels whatever the size",
        differences=(
            "The paper ends with a gain and an offset for its display (192, -30), which do not "
            "fit 0..1; each channel is stretched between percentiles instead, as in A. B. Petro, "
            "C. Sbert, J.-M. Morel: Multiscale Retinex, IPOL 2014. Gain, offset and the paper's "
            "beta (46) have no effect then.",
        ),
    )

    def __init__(self, *, alpha: float = 125.0, clip: float = 1.0, **base: Any) -> None:
        """Keep the settings.

        Args:
            alpha: strength of the colour restoration, above 0.
            clip: percent of the values of each channel that are cut off below, and above; from 0
                to less than 50.
            base: `device`.

        Raises:
            InvalidOption: one is out of its range.
        """
        if not (math.isfinite(alpha) and alpha > 0):
            msg = f"msrcr.alpha must be a finite number above 0, not {alpha}"
            raise InvalidOption(msg)
        if not 0 <= clip < 50:
            msg = f"msrcr.clip must be a percentage from 0 to less than 50, not {clip}"
            raise InvalidOption(msg)
        super().__init__(**base)
        self.alpha = alpha
        self.clip = clip

    def enhance_batch(self, batch: "torch.Tensor") -> "torch.Tensor":
        """Enhance float32 (N, 3, H, W), on the CPU and without rounding to 8 bits.

        Raises:
            ArrayContract: `batch` is not float32 (N, 3, H, W).
        """
        import torch

        check_batch(batch)
        images = batch.detach().clamp(0.0, 1.0).nan_to_num(0.0).permute(0, 2, 3, 1).cpu().numpy()
        answers = np.stack([self._restore(np.ascontiguousarray(image)) for image in images])
        return torch.from_numpy(answers).permute(0, 3, 1, 2).contiguous().to(self.device)

    def _restore(self, image: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
        values = image * np.float32(255) + np.float32(1)
        logarithm = np.log(values)
        retinex = np.zeros_like(values)
        for sigma in _SCALES:
            retinex += logarithm - np.log(gaussian_surroundings(values, sigma))
        retinex /= np.float32(len(_SCALES))
        total = values.sum(axis=2, keepdims=True)
        retinex *= np.log(np.float32(self.alpha) * values / total)
        answer = image.copy()
        for channel in range(3):
            of_channel = retinex[..., channel]
            low, high = np.percentile(of_channel, (self.clip, 100 - self.clip))
            if high - low > _FLAT:  # a flat image stays as it is
                answer[..., channel] = ((of_channel - low) / (high - low)).clip(0, 1)
        return answer


def gaussian_surroundings(values: npt.NDArray[np.float32], sigma: float) -> npt.NDArray[np.float32]:
    """Gaussian mean of each channel of float32 (H, W, 3), mirrored with the border doubled.

    Wide Gaussians are taken of a smaller image and brought back, which costs a hundredth at the
    widest scale; the widening by both resizings is taken off the Gaussian.
    """
    import cv2

    height, width = values.shape[:2]
    factor = max(1, 2 ** int(math.log2(sigma / _SHARP_ENOUGH)))
    small_size = (max(1, math.ceil(width / factor)), max(1, math.ceil(height / factor)))
    if factor == 1 or min(small_size) < 4:
        blurred = cv2.GaussianBlur(values, (0, 0), sigma, borderType=cv2.BORDER_REFLECT)
        return np.asarray(blurred, dtype=np.float32)
    small = cv2.resize(values, small_size, interpolation=cv2.INTER_AREA)
    # variances, in pixels of the small image: a box of width 1 has 1/12, a triangle of 2 has 1/6
    widths = [
        math.sqrt((sigma * there / here) ** 2 - 1 / 12 - 1 / 6)
        for there, here in zip(small_size, (width, height), strict=True)
    ]
    small = cv2.GaussianBlur(
        small, (0, 0), widths[0], sigmaY=widths[1], borderType=cv2.BORDER_REFLECT
    )
    wide = cv2.resize(small, (width, height), interpolation=cv2.INTER_LINEAR)
    return np.asarray(wide, dtype=np.float32)
