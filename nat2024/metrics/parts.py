"""Frames of several sequences, one after the other, computed with at once."""

import functools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from nat2024.types import Flags


@dataclass(frozen=True, eq=False)
class Parts:
    """Which rows of an array belong to which of several sequences.

    Attributes:
        lengths: int64 (s,), rows of each sequence, at least one.
        starts: intp (s,), its first row.
    """

    lengths: npt.NDArray[np.int64]
    starts: npt.NDArray[np.intp]

    @classmethod
    def of(cls, lengths: Sequence[int]) -> "Parts":
        """The parts of these lengths."""
        counts = np.array(lengths, dtype=np.int64)
        return cls(counts, (counts.cumsum() - counts).astype(np.intp, copy=False))

    @functools.cached_property
    def number(self) -> npt.NDArray[np.intp]:
        """Intp (n,), the sequence of each row."""
        return np.repeat(np.arange(self.lengths.size), self.lengths)

    def __len__(self) -> int:
        """Number of sequences."""
        return len(self.lengths)

    def slices(self) -> Iterator[slice]:
        """The rows of each sequence."""
        for start, length in zip(self.starts.tolist(), self.lengths.tolist(), strict=True):
            yield slice(start, start + length)

    def count(self, flags: Flags) -> npt.NDArray[np.int64]:
        """How many rows of each sequence are True, int64 (s,)."""
        if self.lengths.size == 1:
            return np.array([np.count_nonzero(flags)], dtype=np.int64)
        found: npt.NDArray[np.int64] = np.add.reduceat(flags, self.starts, dtype=np.int64)
        return found

    def histograms(self, ranks: npt.NDArray[np.intp], bins: int) -> npt.NDArray[np.int64]:
        """How many rows of each sequence have each rank below `bins`, int64 (s, bins)."""
        sequences = self.lengths.size
        if sequences > 1:
            ranks = ranks + self.number * bins
        return np.bincount(ranks, minlength=bins * sequences).reshape(sequences, bins)
