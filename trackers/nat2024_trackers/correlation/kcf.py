"""The tracker `kcf`: a kernelised correlation filter on gradients, without change of size."""

from typing import ClassVar

import numpy as np

from nat2024.cards import Card, read_card
from nat2024.registry import register_tracker
from nat2024_trackers.correlation.features import gradient_maps
from nat2024_trackers.correlation.fhog import FHOG, Array
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

PADDING = 1.5
CELL = 4
AREA = (120.0**2, 200.0**2)
KERNEL_SIGMA = 0.5
LABEL_SIGMA = 0.1
REGULARISATION = 1e-4
LEARNING_RATE = 0.02


@register_tracker("kcf")
class KCF(CorrelationTracker):
    """Kernelised correlation filter with a Gaussian kernel on 31 gradient maps.

    The size of the box never changes. The score is the peak-to-sidelobe ratio of the response.
    """

    card: ClassVar[Card] = read_card("nat2024_trackers.correlation", "kcf.toml")
    _hog: FHOG
    _weights: Array
    _label: Spectrum
    _template: Spectrum
    _dual: Spectrum

    def window_for(self, size: tuple[float, float]) -> Window:
        """Two and a half times the target."""
        return window_around(size, padding=PADDING, shape="proportional", cell=CELL, area=AREA)

    def begin(self, window: Window, patch: Pixels) -> None:
        """Learn the first patch."""
        rows, columns = window.rows, window.columns
        self._hog = FHOG(rows, columns, CELL)
        self._weights = hann_window(rows, columns)
        label = gaussian_label(rows, columns, window.label_sigma(LABEL_SIGMA))
        self._label = transform(label[None])[0]
        self._template = self._spectrum(patch)
        self._dual = self._solve(self._template)

    def find(self, patch: Pixels) -> Found:
        """The largest kernel response."""
        spectrum = self._kernel(self._spectrum(patch), self._template) * self._dual
        response = inverse(spectrum, self._hog.columns)
        down, right = peak(spectrum, response)[:2]
        return Found((right * CELL, down * CELL), peak_to_sidelobe(response, down, right))

    def learn(self, patch: Pixels) -> None:
        """Template and dual coefficients follow at the learning rate."""
        template, rate = self._spectrum(patch), np.float32(LEARNING_RATE)
        self._dual += rate * (self._solve(template) - self._dual)
        self._template += rate * (template - self._template)

    def _solve(self, template: Spectrum) -> Spectrum:
        """Dual coefficients of kernel ridge regression onto the label."""
        kernel = self._kernel(template, template)
        dual: Spectrum = self._label / (kernel + np.float32(REGULARISATION))
        return dual

    def _spectrum(self, patch: Pixels) -> Spectrum:
        return transform(gradient_maps(patch, self._hog) * self._weights)

    def _kernel(self, one: Spectrum, other: Spectrum) -> Spectrum:
        """Transform of the Gaussian kernel between `one` and every shift of `other`."""
        columns, cells = self._hog.columns, self._weights.size
        correlation = inverse((one * np.conj(other)).sum(axis=0), columns)
        norms = self._energy(one) + self._energy(other)
        distance = np.maximum(norms - 2 * correlation, 0) / (cells * len(one))
        kernel = np.exp(-distance / KERNEL_SIGMA**2).astype(np.float32)
        spectrum: Spectrum = transform(kernel[None])[0]
        return spectrum

    def _energy(self, spectrum: Spectrum) -> float:
        """Sum of the squares of the maps behind a spectrum (Parseval)."""
        return float(inverse((spectrum * np.conj(spectrum)).sum(axis=0), self._hog.columns)[0, 0])
