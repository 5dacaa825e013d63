"""The tracker `fdsst`: a compressed translation filter and a one-dimensional scale filter."""

from typing import ClassVar

import numpy as np

from nat2024.cards import Card, read_card
from nat2024.registry import register_tracker
from nat2024_trackers.correlation.features import color_maps, gradient_maps
from nat2024_trackers.correlation.fhog import FHOG, Array
from nat2024_trackers.correlation.fourier import (
    Spectrum,
    gaussian_label,
    inverse,
    peak,
    transform,
)
from nat2024_trackers.correlation.samples import Pixels
from nat2024_trackers.correlation.scale import ScaleFilter
from nat2024_trackers.correlation.tracker import CorrelationTracker, Found, peak_to_sidelobe
from nat2024_trackers.correlation.windows import Window, hann_window, target_window, window_around

PADDING = 2.0
CELL = 4
AREA = 160.0**2
"""Samples in the search window."""

SIGMA = 1 / 16
"""Width of the label, as a share of the target's mean side."""

REGULARISATION = 0.01
LEARNING_RATE = 0.025
DIMENSIONS = 18
"""Maps that are left of 34 after compression."""

TARGET_EXTENT = 1.5
"""Width of the cosine window on the template, in targets."""


@register_tracker("fdsst")
class FDSST(CorrelationTracker):
    """Fast discriminative scale space tracking, with colour and a template without background.

    The score is the peak-to-sidelobe ratio of the translation filter's response.
    """

    card: ClassVar[Card] = read_card("nat2024_trackers.correlation", "fdsst.toml")
    _filter: "TranslationFilter"
    _scale: ScaleFilter

    def window_for(self, size: tuple[float, float]) -> Window:
        """The same room on all sides, resampled to one area whatever the target's size."""
        return window_around(size, padding=PADDING, shape="even", cell=CELL, area=(AREA, AREA))

    def begin(self, window: Window, patch: Pixels) -> None:
        """Learn the first patch."""
        self._filter = TranslationFilter(window)
        self._scale = ScaleFilter(window.target)
        self.learn(patch)

    def find(self, patch: Pixels) -> Found:
        """First the place, then, in the same patch around that place, the size."""
        (right, down), score = self._filter.find(patch)
        center, size = _middle(patch), self._target_size()
        factor = self._scale.factor(patch, (center[0] + right, center[1] + down), size)
        return Found((right, down), score, factor)

    def learn(self, patch: Pixels) -> None:
        """Both filters learn from the same patch."""
        self._filter.learn(patch)
        self._scale.learn(patch, _middle(patch), self._target_size())

    def _target_size(self) -> tuple[float, float]:
        across, down = self._window.target
        return across * CELL, down * CELL


class TranslationFilter:
    """Where the target is: a correlation filter on principal components of gradients and colour.

    The template is an average of uncompressed maps, so that every frame can choose its own
    components. The numerator sees the target only, the energy in the denominator the target with
    its surroundings: what is frequent around the target counts less.
    """

    def __init__(self, window: Window) -> None:
        """Start empty."""
        rows, columns = window.rows, window.columns
        self._cell = window.cell
        self._hog = FHOG(rows, columns, window.cell)
        label = gaussian_label(rows, columns, window.label_sigma(SIGMA))
        self._label = transform(label[None])
        self._around = hann_window(rows, columns)
        self._inside = target_window(window, TARGET_EXTENT)
        self._template: Array | None = None
        self._energy: Array = np.zeros(self._label.shape[1:], dtype=np.float32)
        self._components: Array
        self._numerator: Spectrum

    def learn(self, patch: Pixels) -> None:
        """Take in a patch with the target in its middle."""
        maps, rate = self._maps(patch), np.float32(LEARNING_RATE)
        if self._template is None:
            self._template, rate = maps, np.float32(1)
        else:
            self._template += rate * (maps - self._template)
        self._components = principal_components(self._template)
        seen = transform(self._compress(self._template) * self._inside)
        self._numerator = self._label * np.conj(seen)
        around = transform(self._compress(maps) * self._around)
        self._energy += rate * (_energy(around) - self._energy)

    def find(self, patch: Pixels) -> tuple[tuple[float, float], float]:
        """Offset from the middle of the patch in samples, right and down, and the score."""
        seen = transform(self._compress(self._maps(patch)) * self._around)
        spectrum = (self._numerator * seen).sum(axis=0) / (self._energy + REGULARISATION)
        response = inverse(spectrum, self._hog.columns)
        down, right = peak(spectrum, response)[:2]
        score = peak_to_sidelobe(response, down, right)
        return (right * self._cell, down * self._cell), score

    def _maps(self, patch: Pixels) -> Array:
        return np.concatenate([gradient_maps(patch, self._hog), color_maps(patch, self._hog)])

    def _compress(self, maps: Array) -> Array:
        compressed: Array = np.tensordot(self._components, maps, axes=1)
        return compressed


def principal_components(maps: Array) -> Array:
    """Directions of the largest energy among maps, float32 (18, number of maps)."""
    flat = maps.reshape(len(maps), -1)
    vectors = np.linalg.eigh(flat @ flat.T)[1]
    return np.ascontiguousarray(vectors[:, ::-1][:, :DIMENSIONS].T)


def _energy(spectrum: Spectrum) -> Array:
    energy: Array = (np.square(spectrum.real) + np.square(spectrum.imag)).sum(axis=0)
    return energy


def _middle(patch: Pixels) -> tuple[float, float]:
    return patch.shape[1] / 2, patch.shape[0] / 2
