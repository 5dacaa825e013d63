"""Crops of several sequences, cut side by side into one batch."""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from nat2024.types import Image
from nat2024_trackers.siamese.crops import crop
from nat2024_trackers.siamese.state import Target

if TYPE_CHECKING:
    import torch

_FEW = 4
"""Crops that one thread cuts sooner than it could share them out."""


class Crops:
    """Where the crops for a device lie until they go there."""

    def __init__(self, device: str) -> None:
        """Keep in mind where they go; memory comes with the first crops."""
        self._is_far = device.startswith("cuda")
        self._pinned: dict[int, torch.Tensor] = {}

    def cut(
        self,
        size: int,
        images: Sequence[Image],
        targets: Sequence[Target],
        sides: Sequence[int],
        fills: Sequence[npt.NDArray[np.uint8]],
    ) -> "torch.Tensor":
        """Cut one crop out of each image, by as many threads as OpenCV may use.

        Args:
            size: of the crops in pixels.
            images: uint8 (H, W, 3) each.
            targets: their centres are the crops' centres.
            sides: of the squares in image pixels.
            fills: colours outside the images.

        Returns:
            uint8 (n, size, size, 3) on the CPU, valid until the next crops of that size are cut: it
            must have been copied to the device by then.
        """
        import cv2

        batch = self._room(len(images), size)
        rows = batch.numpy()
        workers = min(cv2.getNumThreads(), len(images) // _FEW) if self._is_far else 1

        def cut_some(start: int) -> None:
            for row in range(start, len(images), max(1, workers)):
                crop(images[row], targets[row], sides[row], size, fills[row], rows[row])

        if workers > 1:
            list(_pool(workers).map(cut_some, range(workers)))
        else:
            cut_some(0)
        return batch

    def _room(self, count: int, size: int) -> "torch.Tensor":
        import torch

        shape = (count, size, size, 3)
        if not self._is_far:
            return torch.empty(shape, dtype=torch.uint8)
        room = self._pinned.get(size)
        if room is None or len(room) < count:
            # What is pinned is copied to a CUDA device at once, without a detour.
            room = self._pinned[size] = torch.empty(shape, dtype=torch.uint8, pin_memory=True)
        return room[:count]


@cache
def _pool(workers: int) -> ThreadPoolExecutor:
    return ThreadPoolExecutor(workers, thread_name_prefix="nat2024 crops")
