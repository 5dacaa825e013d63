"""The loop of all correlation filters: look, find, move, look again, learn."""

from abc import abstractmethod
from dataclasses import dataclass

import numpy as np

from nat2024.errors import UsageError
from nat2024.images import image_to_batch
from nat2024.interfaces import Tracker, run_enhancer
from nat2024.types import Box, Image
from nat2024_trackers.correlation.fhog import Array
from nat2024_trackers.correlation.samples import Pixels, cut
from nat2024_trackers.correlation.windows import Target, Window

SMALLEST_TARGET = 4.0
"""Side in image pixels below which a shrinking target does not shrink further."""

_SIDELOBE_GAP = 5
"""Cells around the peak that do not count as side lobes: a square of 11 x 11."""


@dataclass(frozen=True, slots=True)
class Found:
    """What a filter says about one search patch.

    Attributes:
        offset: from the middle of the patch, right and down, in samples.
        score: how clear it was.
        factor: how many times larger than before.
        trusted: whether to learn from it.
    """

    offset: tuple[float, float]
    score: float
    factor: float = 1.0
    trusted: bool = True


class CorrelationTracker(Tracker):
    """A correlation filter; a subclass gives `window_for`, `begin`, `find` and `learn`.

    Everything is a function of the frames: no random numbers without a fixed seed, no threads.
    With an enhancer and the scope "patch" every patch that is looked at is enhanced: one of the
    first frame, two of each other frame (one to find the target in, one around the place found to
    learn from). The centre never leaves the frame, the box may; frames of another size are followed
    at the same pixels.

    Attributes:
        target: where the target is believed to be, None before the first `init`.
    """

    target: Target | None = None
    _window: Window

    @abstractmethod
    def window_for(self, size: tuple[float, float]) -> Window:
        """The search window of a target of this width and height."""

    @abstractmethod
    def begin(self, window: Window, patch: Pixels) -> None:
        """Forget everything, and learn the first patch, uint8 or float32 (h, w, 3) in 0..255."""

    @abstractmethod
    def find(self, patch: Pixels) -> Found:
        """Where in a patch around the last place the target is."""

    @abstractmethod
    def learn(self, patch: Pixels) -> None:
        """Take in a patch with the target in its middle."""

    def start(self, image: Image, box: Box) -> Box:
        """Start on an image; the answer is the box as given."""
        target = Target.from_annotation(box)
        self._window = self.window_for(target.size)
        self.begin(self._window, self._look(image, target))
        self.target = target
        return box.copy()

    def advance(self, image: Image) -> tuple[Box, float]:
        """Follow into the next image."""
        if self.target is None:
            msg = f"{self.name}: update before init; call init(image, box) on the first frame"
            raise UsageError(msg)
        target, frame_size = self.target, (image.shape[1], image.shape[0])
        found = self.find(self._look(image, target))
        pixels = target.scale / self._window.density
        offset = (found.offset[0] * pixels, found.offset[1] * pixels)
        moved = target.moved(offset, found.factor, frame_size)
        self.target = target = _within_limits(moved, target, frame_size)
        if found.trusted:
            self.learn(self._look(image, target))
        return target.box, found.score

    def _look(self, image: Image, target: Target) -> Pixels:
        """The search patch around a target, enhanced where the scope is "patch"."""
        window = self._window
        patch = cut(image, target.center, window.extent(target.scale), window.size)
        if self.enhancer is None or self.scope != "patch":
            return patch
        return self._enhanced(patch.astype(np.uint8, copy=False))

    def _enhanced(self, patch: Image) -> Pixels:
        """The patch through the enhancer, float32 in 0..255, not rounded."""
        import torch

        assert self.enhancer is not None
        better = run_enhancer(self.enhancer, image_to_batch(patch), self.device)
        pixels = torch.nan_to_num(better.float(), nan=0.0).clamp(0.0, 1.0) * 255.0
        return np.ascontiguousarray(pixels[0].permute(1, 2, 0).cpu().numpy())


def peak_to_sidelobe(response: Array, down: float, right: float) -> float:
    """Peak-to-sidelobe ratio of a response (Bolme et al. 2010); 0 where it is flat.

    Args:
        response: float32 (rows, columns), wrapped around.
        down: row of the peak, negative ones counted from the end.
        right: column of the peak.
    """
    rows, columns = response.shape
    middle = rows // 2, columns // 2
    centred = np.roll(response, (middle[0] - round(down), middle[1] - round(right)), axis=(0, 1))
    lobes = np.ones(response.shape, dtype=np.bool_)
    gaps = [min(_SIDELOBE_GAP, (cells - 1) // 4) for cells in (rows, columns)]
    box = tuple(slice(m - gap, m + gap + 1) for m, gap in zip(middle, gaps, strict=True))
    lobes[box] = False
    others = centred[lobes]
    spread = float(others.std())
    if not spread > 0:
        return 0.0
    return (float(centred[middle]) - float(others.mean())) / spread


def _within_limits(target: Target, before: Target, frame_size: tuple[int, int]) -> Target:
    """The target no smaller than a few pixels and no larger than the frame.

    One that is beyond a limit already may stay as it is or come back.
    """
    smaller, larger = (
        min(target.size),
        max(side / limit for side, limit in zip(target.size, frame_size, strict=True)),
    )
    least = min(before.scale, SMALLEST_TARGET / smaller)
    most = max(before.scale, 1 / larger)
    scale = float(np.clip(target.scale, least, most))
    return Target(target.center, target.size, scale)
