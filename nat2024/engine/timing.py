"""Measuring what enhancing costs apart from tracking."""

import time
from typing import TYPE_CHECKING

from nat2024.interfaces import BatchEnhancer, enhance_frame
from nat2024.types import Image

if TYPE_CHECKING:
    import torch


class TimedEnhancer:
    """Passes everything on to an enhancer and adds up the seconds that it takes.

    On CUDA devices the clock waits for the device at both ends, so that the enhancer pays for its
    own work and for nothing else.
    """

    def __init__(self, enhancer: BatchEnhancer, device: str) -> None:
        self.enhancer = enhancer
        self.device = device
        self._seconds = 0.0

    def enhance_batch(self, batch: "torch.Tensor") -> "torch.Tensor":
        """As `Enhancer.enhance_batch`."""
        start = now(self.device)
        enhanced = self.enhancer.enhance_batch(batch)
        self._seconds += now(self.device) - start
        return enhanced

    def enhance_frame(self, frame: Image) -> Image:
        """A whole BGR frame; what a tracker with the scope "frame" calls."""
        start = now(self.device)
        enhanced = enhance_frame(self.enhancer, frame, self.device)
        self._seconds += now(self.device) - start
        return enhanced

    def take(self) -> float:
        """Seconds since the last call of this method."""
        seconds, self._seconds = self._seconds, 0.0
        return seconds


def now(device: str = "cpu") -> float:
    """Seconds of a steady clock, after waiting for what the device still has to do."""
    if device.startswith("cuda"):
        import torch

        torch.cuda.synchronize(device)
    return time.perf_counter()
