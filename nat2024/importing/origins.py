"""The pixel origin of a writer, told by the first rows of its results.

The first row of a result is the initial box as its writer keeps it: pysot-style testers add half a
pixel to x and y, pytracking's do not, 0-based files of a 1-based annotation are one pixel off. The
offset is the same in every sequence of a folder, so a sequence that differs from the others was
started on another box.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from nat2024.types import Boxes

_EQUAL_PX = 0.02  # the toolkit of GOT-10k keeps three decimals
_NEAR_PX = 1.5  # rounding and half pixels stay within this; another target does not
_MEANINGS = {
    (0.5, 0.5): "as the testers of pysot write them",
    (0.0, 0.0): "as annotated",
    (
        -1.0,
        -1.0,
    ): "0-based: all rows are probably one pixel off (`export --shift-origin`)",
    (-0.5, -0.5): "half a pixel off, as some MATLAB results are",
}


@dataclass(frozen=True, slots=True)
class FirstRows:
    """How the first rows of a run lie beside the annotation.

    Attributes:
        offset: (x, y) in pixels, the median over sequences.
        alike: whether all sequences but `others` have this very offset.
        compared: number of sequences.
        others: names of the sequences that were started elsewhere.
    """

    offset: tuple[float, float]
    alike: bool
    compared: int
    others: tuple[str, ...] = ()

    @property
    def text(self) -> str:
        """The offset in words."""
        x, y = self.offset
        about = "" if self.alike else "about "
        meaning = _MEANINGS.get(self.offset, "") if self.alike else "not the same everywhere"
        where = f"first rows lie {about}({x:+g}, {y:+g}) px from the annotation"
        return f"{where}, {meaning}" if meaning else where

    @property
    def is_zero_based(self) -> bool:
        """Whether rows begin at 0 where the annotation begins at 1."""
        return self.alike and self.offset == (-1.0, -1.0)


def compare_first_rows(first: Mapping[str, Boxes], truth: Mapping[str, Boxes]) -> FirstRows | None:
    """Compare first rows with annotated first boxes.

    Args:
        first: first row, float64 (4,), by sequence.
        truth: annotated first box, float64 (4,), by sequence.

    Returns:
        What they tell, None where no sequence can be compared.
    """
    names = [n for n in first if n in truth and _is_box(first[n]) and _is_box(truth[n])]
    if not names:
        return None
    offsets = np.array([first[name][:2] - truth[name][:2] for name in names])
    sizes = np.array([first[name][2:] - truth[name][2:] for name in names])
    middle = np.median(offsets, axis=0)
    far = (np.abs(offsets - middle).max(axis=1) > _NEAR_PX) | (np.abs(sizes).max(axis=1) > _NEAR_PX)
    near = offsets[~far] if not far.all() else offsets
    alike = bool((np.abs(near - np.median(near, axis=0)) <= _EQUAL_PX).all())
    x, y = (round(float(value), 1) + 0.0 for value in np.median(near, axis=0))
    others = tuple(name for name, is_far in zip(names, far.tolist(), strict=True) if is_far)
    return FirstRows((x, y), alike, len(names), others)


def _is_box(box: Boxes) -> bool:
    return bool(np.isfinite(box).all())
