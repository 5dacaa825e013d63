"""What the Siamese loop carries: the target, the first frame's traces, the constants, one step.

Everything is frozen: a step takes a state and gives the next one.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
import numpy.typing as npt

from nat2024.types import Box

if TYPE_CHECKING:
    import torch

Features: TypeAlias = "tuple[torch.Tensor, ...]"
"""Template side of a network; the first axis of every tensor counts the sequences."""


@dataclass(frozen=True, slots=True)
class Constants:
    """Numbers that tell one Siamese tracker from another; none is read from a global.

    Attributes:
        instance_size: side of the search crop that the network sees, in pixels.
        map_size: cells along one side of the response map.
        stride: crop pixels between two cells.
        penalty_k: strength of the penalty on changes of scale and shape.
        window_influence: share of the cosine window in the penalised score, 0..1.
        learning_rate: share of the predicted size taken over at penalty and score 1.
        anchors: candidates in each cell.
        exemplar_size: side of the template crop that the network sees, in pixels.
        context_amount: share of width + height added around the target.
        ratio_epsilon: guard of the divisions in the penalty: 1e-5 in the official SiamAPN,
            SiamAPN++, HiFT and LPAT, absent (0) in pysot and NanoTrack.
        large_target_share: HiFT and LPAT search targets above this share of the image with the
            scale of the first frame; None where there is no such rule.
    """

    instance_size: int
    map_size: int
    stride: int
    penalty_k: float
    window_influence: float
    learning_rate: float
    anchors: int = 1
    exemplar_size: int = 127
    context_amount: float = 0.5
    ratio_epsilon: float = 0.0
    large_target_share: float | None = None


@dataclass(frozen=True, slots=True)
class Target:
    """Where the target is believed to be, in image pixels: all that changes between frames."""

    center_x: float
    center_y: float
    width: float
    height: float

    @classmethod
    def from_annotation(cls, box: Box) -> "Target":
        """The target of an annotated box x, y, w, h: centre (x + w/2, y + h/2)."""
        x, y, width, height = (float(value) for value in box)
        return cls(x + width / 2, y + height / 2, width, height)

    @property
    def box(self) -> Box:
        """Float64 (4,): x, y, w, h, not clipped to the image."""
        left, top = self.center_x - self.width / 2, self.center_y - self.height / 2
        return np.array([left, top, self.width, self.height], dtype=np.float64)


@dataclass(frozen=True, slots=True)
class FirstFrame:
    """What the first frame leaves for the rest of its sequence.

    Attributes:
        fill: uint8 (3,), mean colour of the first frame, truncated; fills crops beyond the image.
        template_side: side of the template crop in image pixels.
        features: template side of the network, batch of one.
    """

    fill: npt.NDArray[np.uint8]
    template_side: int
    features: Features


@dataclass(frozen=True, slots=True)
class Candidates:
    """Decoded maps of a batch of search crops.

    Attributes:
        scores: (n, k) raw scores.
        boxes: (n, 4, k): centre offset x, y from the crop's centre, width, height; crop pixels.
    """

    scores: npt.NDArray[np.floating]
    boxes: npt.NDArray[np.floating]


@dataclass(frozen=True, slots=True)
class Step:
    """The outcome of one frame.

    Attributes:
        target: the new state.
        score: raw score of the chosen candidate.
        pscore: its penalised and windowed score.
        index: its place in the official flat order, -1 where no candidate was usable.
        crop_side: side of the search crop in image pixels.
    """

    target: Target
    score: float
    pscore: float
    index: int
    crop_side: int

    @property
    def box(self) -> Box:
        """Float64 (4,): x, y, w, h, not clipped to the image."""
        return self.target.box
