"""Measuring what enhancing costs apart from tracking."""

import time
from typing import TYPE_CHECKING, NamedTuple

from nat2024.engine.sharing import SharedFrames
from nat2024.interfaces import BatchEnhancer, enhance_frame
from nat2024.types import Image

if TYPE_CHECKING:
    import torch


class Spent(NamedTuple):
    """Seconds of enhancing.

    Attributes:
        cost: what enhancing costs; that of a shared frame counts for everybody who uses it.
        here: what passed while the tracker waited; next to nothing for a frame made before.
    """

    cost: float
    here: float


class TimedEnhancer:
    """Passes everything on to an enhancer and adds up the seconds that it takes.

    On CUDA devices the clock waits for the device at both ends, so that the enhancer pays for its
    own work and for nothing else.
    """

    def __init__(
        self, enhancer: BatchEnhancer, device: str, shared: SharedFrames | None = None
    ) -> None:
        """Wrap an enhancer; `shared` are the frames of all who use the same one."""
        self.enhancer = enhancer
        self.device = device
        self.shared = shared
        self._cost = self._here = 0.0

    def enhance_batch(self, batch: "torch.Tensor") -> "torch.Tensor":
        """As `Enhancer.enhance_batch`."""
        start = now(self.device)
        enhanced = self.enhancer.enhance_batch(batch)
        seconds = now(self.device) - start
        self._cost += seconds
        self._here += seconds
        return enhanced

    def enhance_frame(self, frame: Image) -> Image:
        """A whole BGR frame; what a tracker with the scope "frame" calls."""
        start = now(self.device)
        if self.shared is None:
            enhanced, cost = self._enhance_frame(frame)
        else:
            enhanced, cost = self.shared.get(frame, lambda: self._enhance_frame(frame))
        self._cost += cost
        self._here += now(self.device) - start
        return enhanced

    def _enhance_frame(self, frame: Image) -> tuple[Image, float]:
        start = now(self.device)
        enhanced = enhance_frame(self.enhancer, frame, self.device)
        return enhanced, now(self.device) - start

    def take(self) -> Spent:
        """Seconds since the last call of this method."""
        spent = Spent(self._cost, self._here)
        self._cost = self._here = 0.0
        return spent


def now(device: str = "cpu") -> float:
    """Seconds of a steady clock, after waiting for what the device still has to do."""
    if device.startswith("cuda"):
        import torch

        torch.cuda.synchronize(device)
    return time.perf_counter()
