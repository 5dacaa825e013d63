"""What boxes alone tell: which are valid, how they move and how their size changes."""

from dataclasses import dataclass

import numpy as np

from nat2024.types import Boxes, Flags, Floats, Sequence


@dataclass(frozen=True, slots=True)
class BoxTrace:
    """Motion and size of a target, one number a frame; NaN where there is none.

    Attributes:
        annotated: bool (n,), frames that have a row of ground truth.
        absent: bool (n,), annotated frames whose row holds NaN or an infinite number.
        valid: bool (n,), frames with a box of finite numbers and some area.
        centres: float64 (n, 2).
        areas: float64 (n,), width x height in pixels.
        aspects: float64 (n,), width / height.
        steps: float64 (n,), distance of the centre from that of the frame before, both valid;
            all NaN where only some frames are annotated.
    """

    annotated: Flags
    absent: Flags
    valid: Flags
    centres: Floats
    areas: Floats
    aspects: Floats
    steps: Floats

    @property
    def sizes(self) -> Floats:
        """Square roots of the areas, float64 (n,)."""
        sizes: Floats = np.sqrt(self.areas)
        return sizes

    @property
    def relative_steps(self) -> Floats:
        """Steps over the size of the box, float64 (n,)."""
        with _any_number():
            relative: Floats = self.steps / self.sizes
        return relative

    def changes(self, values: Floats) -> Floats:
        """`values` over the first valid one, as a factor of at least 1 either way."""
        if not self.valid.any():
            return np.full(len(values), np.nan)
        with _any_number():
            ratios = values / values[int(np.argmax(self.valid))]
            found: Floats = np.maximum(ratios, 1 / ratios)
        return found


def trace_boxes(sequence: Sequence) -> BoxTrace:
    """Look at the boxes of a sequence; see `BoxTrace`."""
    boxes = sequence.boxes
    annotated = np.ones(len(boxes), dtype=bool)
    if sequence.keyframes is not None:
        annotated[:] = False
        annotated[sequence.keyframes] = True
    finite = np.asarray(np.isfinite(boxes).all(axis=1))
    with _any_number():
        area = boxes[:, 2] * boxes[:, 3]
    valid = finite & np.asarray((boxes[:, 2:] > 0).all(axis=1)) & (area > 0)
    kept: Boxes = np.where(valid[:, None], boxes, np.nan)
    width, height = kept[:, 2], kept[:, 3]
    centres = kept[:, :2] + kept[:, 2:] / 2
    steps = np.full(len(boxes), np.nan)
    if sequence.keyframes is None:
        steps[1:] = np.hypot(*np.diff(centres, axis=0).T)
    with _any_number():
        aspects = width / height
    return BoxTrace(annotated, annotated & ~finite, valid, centres, width * height, aspects, steps)


def _any_number() -> np.errstate:
    """Boxes of any size pass, however absurd; what is infinite then exceeds every threshold."""
    return np.errstate(over="ignore", under="ignore", divide="ignore", invalid="ignore")
