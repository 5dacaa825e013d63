"""The tracker `mosse`: minimum output sum of squared error on grey values, no change of size."""

from typing import Any, ClassVar

import numpy as np

from nat2024.cards import Card, read_card
from nat2024.registry import register_tracker
from nat2024_trackers.correlation.features import log_grey
from nat2024_trackers.correlation.fhog import Array
from nat2024_trackers.correlation.fourier import (
    Spectrum,
    gaussian_label,
    inverse,
    peak,
    transform,
)
from nat2024_trackers.correlation.samples import Pixels
from nat2024_trackers.correlation.tracker import CorrelationTracker, Found, peak_to_sidelobe
from nat2024_trackers.correlation.windows import Window, hann_window, window_around

PADDING = 1.0
AREA = (64.0**2, 128.0**2)
LABEL_SIGMA = 2.0
"""In samples."""

REGULARISATION = 0.1
LEARNING_RATE = 0.125
TRUSTED_RATIO = 5.7
"""Peak-to-sidelobe ratio below which nothing is learned."""

PERTURBATIONS = 8
SEED = 2010
LARGEST_TURN = np.deg2rad(10.0)
LARGEST_STRETCH = 0.1


@register_tracker("mosse")
class MOSSE(CorrelationTracker):
    """Minimum output sum of squared error filter on grey values.

    The size of the box never changes. The score is the peak-to-sidelobe ratio of the response.
    """

    card: ClassVar[Card] = read_card("nat2024_trackers.correlation", "mosse.toml")
    _weights: Array
    _label: Spectrum
    _numerator: Spectrum
    _energy: Spectrum

    def window_for(self, size: tuple[float, float]) -> Window:
        """Twice the target."""
        return window_around(size, padding=PADDING, shape="proportional", cell=1, area=AREA)

    def begin(self, window: Window, patch: Pixels) -> None:
        """Learn the first patch and eight small distortions of it."""
        rows, columns = window.rows, window.columns
        self._weights = hann_window(rows, columns)
        self._label = transform(gaussian_label(rows, columns, LABEL_SIGMA)[None])[0]
        looks = [patch, *distorted(patch)]
        seen = transform(np.stack([log_grey(look) * self._weights for look in looks]))
        self._numerator = (self._label * np.conj(seen)).sum(axis=0)
        self._energy = (seen * np.conj(seen)).sum(axis=0)

    def find(self, patch: Pixels) -> Found:
        """The largest response; below a ratio of 5.7 the filter stays as it is."""
        seen = self._spectrum(patch)
        spectrum = seen * self._numerator / (self._energy + np.float32(REGULARISATION))
        response = inverse(spectrum, self._weights.shape[1])
        down, right = peak(spectrum, response)[:2]
        score = peak_to_sidelobe(response, down, right)
        return Found((right, down), score, trusted=score >= TRUSTED_RATIO)

    def learn(self, patch: Pixels) -> None:
        """Numerator and energy follow at the learning rate."""
        seen, rate = self._spectrum(patch), np.float32(LEARNING_RATE)
        self._numerator += rate * (self._label * np.conj(seen) - self._numerator)
        self._energy += rate * (seen * np.conj(seen) - self._energy)

    def _spectrum(self, patch: Pixels) -> Spectrum:
        spectrum: Spectrum = transform((log_grey(patch) * self._weights)[None])[0]
        return spectrum


def distorted(patch: Pixels) -> list[Pixels]:
    """The patch turned and stretched about its middle, the same way on every call."""
    import cv2

    height, width = patch.shape[:2]
    middle = np.array([(width - 1) / 2, (height - 1) / 2])
    generator = np.random.default_rng(SEED)
    looks: list[Pixels] = []
    for _ in range(PERTURBATIONS):
        turn = generator.uniform(-LARGEST_TURN, LARGEST_TURN)
        stretch = 1 + generator.uniform(-LARGEST_STRETCH, LARGEST_STRETCH, 2)
        rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
        matrix = rotation * stretch
        affine = np.column_stack([matrix, middle - matrix @ middle])
        look: Any = cv2.warpAffine(patch, affine, (width, height), borderMode=cv2.BORDER_REPLICATE)
        looks.append(look)
    return looks
