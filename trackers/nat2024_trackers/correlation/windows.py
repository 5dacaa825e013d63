"""Where a tracker looks: the target, the search window around it, and what weighs its cells."""

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from nat2024.types import Box, Floats
from nat2024_trackers.correlation.fhog import Array
from nat2024_trackers.correlation.fourier import fast_size

SMALLEST_SIDE, LARGEST_SIDE = 1.0, 65536.0
"""Sides in pixels between which windows are made; start boxes beyond are looked at as these."""

LEAST_CELLS = 4
"""Cells that a window has on each axis, at least."""


@dataclass(frozen=True, slots=True)
class Target:
    """Where the target is believed to be.

    Attributes:
        center: x, y in image pixels.
        size: width and height in the first frame.
        scale: times the first frame's size.
    """

    center: tuple[float, float]
    size: tuple[float, float]
    scale: float = 1.0

    @classmethod
    def from_annotation(cls, box: Box) -> "Target":
        """The target of an annotated box x, y, w, h."""
        x, y, width, height = (float(value) for value in box)
        return cls((x + width / 2, y + height / 2), (width, height))

    @property
    def box(self) -> Box:
        """Float64 (4,): x, y, w, h, not clipped to the image."""
        width, height = (side * self.scale for side in self.size)
        x, y = self.center[0] - width / 2, self.center[1] - height / 2
        return np.array([x, y, width, height], dtype=np.float64)

    def moved(
        self, offset: tuple[float, float], factor: float, frame_size: tuple[int, int]
    ) -> "Target":
        """Moved in image pixels and scaled; the centre stays on the frame (width, height)."""
        x, y = (
            float(np.clip(place + step, 0.0, limit))
            for place, step, limit in zip(self.center, offset, frame_size, strict=True)
        )
        return replace(self, center=(x, y), scale=self.scale * factor)


@dataclass(frozen=True, slots=True)
class Window:
    """The part of the image that is searched, resampled to cells of a fixed number.

    Attributes:
        columns: cells across.
        rows: cells down.
        cell: side of a cell in samples; features have one value for each cell.
        density: samples for each image pixel while the target's scale is 1.
        target: width and height of the target in cells.
    """

    columns: int
    rows: int
    cell: int
    density: float
    target: tuple[float, float]

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in samples."""
        return self.columns * self.cell, self.rows * self.cell

    def extent(self, scale: float) -> tuple[float, float]:
        """Width and height in image pixels while the target's scale is `scale`."""
        width, height = self.size
        return width * scale / self.density, height * scale / self.density

    def label_sigma(self, share: float) -> float:
        """Width of the label in cells: `share` of the target's mean side."""
        return share * math.sqrt(self.target[0] * self.target[1])


def window_around(
    size: tuple[float, float],
    *,
    padding: float,
    shape: Literal["proportional", "even"],
    cell: int,
    area: tuple[float, float],
) -> Window:
    """The search window of a target.

    Args:
        size: width and height of the target in image pixels.
        padding: room around the target, as a multiple of its sides.
        shape: "proportional" multiplies both sides; "even" adds the same room to both, a multiple
            of the mean side, so that thin targets are searched for to all sides alike.
        cell: side of a cell in samples.
        area: least and largest area of the window in samples; within them a sample is a pixel.
    """
    width, height = (min(max(side, SMALLEST_SIDE), LARGEST_SIDE) for side in size)
    mean = math.sqrt(width * height)
    room = (mean, mean) if shape == "even" else (width, height)
    wanted = (width + padding * room[0], height + padding * room[1])
    pixels = wanted[0] * wanted[1]
    density = math.sqrt(min(max(pixels, area[0]), area[1]) / pixels)
    columns, rows = (fast_size(max(LEAST_CELLS, round(s * density / cell))) for s in wanted)
    return Window(columns, rows, cell, density, (width * density / cell, height * density / cell))


def hann_window(rows: int, columns: int) -> Array:
    """Cosine window over cells, above zero everywhere."""
    return np.outer(_hann(rows), _hann(columns)).astype(np.float32)


def target_window(window: Window, extent: float) -> Array:
    """Cosine window over `extent` times the target in the middle of a window, 0 around it."""
    across, down = (
        _bell(cells, extent * side)
        for cells, side in zip((window.columns, window.rows), window.target, strict=True)
    )
    return np.outer(down, across).astype(np.float32)


def _hann(count: int) -> Floats:
    return np.hanning(count + 2)[1:-1]


def _bell(cells: int, width: float) -> Floats:
    # At least two cells wide, so that something is left of a target smaller than a cell.
    places = (np.arange(cells) + 0.5 - cells / 2) / max(width, 2.0)
    return np.where(np.abs(places) < 0.5, 0.5 + 0.5 * np.cos(2 * np.pi * places), 0.0)
