from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from nat2024.types import Dataset, Sequence


@dataclass
class Frames:
    """Frames in memory that count how often they are asked for."""

    images: list[np.ndarray]
    asked: int = 0

    @property
    def frame_size(self) -> tuple[int, int]:
        return self.images[0].shape[1], self.images[0].shape[0]

    def __len__(self) -> int:
        return len(self.images)

    def __getitem__(self, index: int) -> np.ndarray:
        self.asked += 1
        return self.images[index]


@pytest.fixture
def make() -> Any:
    """Make a sequence of flat frames from grey levels and boxes."""

    def call(
        boxes: Any, levels: Any = None, *, name: str = "car", size: int = 64, **fields: Any
    ) -> Sequence:
        rows = np.array(boxes, dtype=float).reshape(-1, 4)
        shades = np.full(len(rows) or 4, 60) if levels is None else np.array(levels)
        images = [np.full((size, size, 3), level, np.uint8) for level in shades]
        return Sequence(name, Frames(images), rows, **fields)

    return call


@pytest.fixture
def two(make: Any) -> Dataset:
    """A still dark target with published attributes, and a fast bright one without boxes beside."""
    still = make([[10, 10, 20, 20]] * 4, [10, 10, 10, 10], attributes=frozenset({"LR", "OCC"}))
    fast = make(
        [[0, 0, 10, 10], [30, 0, 10, 10], [30, 0, 40, 5], [np.nan] * 4],
        [100, 150, 60, 60],
        name="fast",
    )
    return Dataset("two", (still, fast), attribute_names=("LR", "OCC"))
