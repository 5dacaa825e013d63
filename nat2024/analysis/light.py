"""The light of a sequence: one pass over its frames, a few numbers for each."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from nat2024.errors import FrameUnreadable, UsageError
from nat2024.measures import (
    MEASURE_SIZE,
    grey,
    light_spread,
    local_grey,
    resize_area,
    saturated_beside_dark,
    target_light_spread,
)
from nat2024.types import Box, Floats, Image, Sequence


@dataclass(frozen=True, slots=True)
class LightTrace:
    """Light in the frames that were looked at; NaN where a target is absent or outside.

    Attributes:
        frames: int (k,), their indices.
        mean: float64 (k,), mean grey level of the frame, 0..1.
        spread: float64 (k,), spread of light over the frame in stops.
        saturated_beside_dark: float64 (k,), share of cells with a lamp beside dark ones.
        target: float64 (k,), mean grey level in the box, 0..255.
        around: float64 (k,), mean grey level in the box enlarged by the context, 0..255.
        target_spread: float64 (k,), spread of light around the target in stops.
    """

    frames: npt.NDArray[np.intp]
    mean: Floats
    spread: Floats
    saturated_beside_dark: Floats
    target: Floats
    around: Floats
    target_spread: Floats


def trace_light(
    sequence: Sequence,
    *,
    every: int = 1,
    context: float = 2.0,
    on_frame: Callable[[], object] | None = None,
    on_unreadable: Callable[[FrameUnreadable], object] | None = None,
) -> LightTrace:
    """Look at every `every`-th frame of a sequence, the first included.

    Args:
        sequence: with or without boxes; only one frame is held at a time.
        every: distance of the frames that are decoded.
        context: sides of the region of `LightTrace.around` over those of the box.
        on_frame: called after each frame, to show progress.
        on_unreadable: called with the error of a frame that cannot be decoded, whose numbers are
            NaN then; None raises it.

    Raises:
        FrameUnreadable: a frame cannot be decoded, and `on_unreadable` is None.
        UsageError: `every` is below 1.
    """
    if every < 1:
        msg = f"every={every}: look at every 1st frame or at fewer"
        raise UsageError(msg)
    indices = np.arange(0, len(sequence), every)
    rows = np.empty((len(indices), 6))
    absent = np.full(4, np.nan)
    for row, index in zip(rows, indices.tolist(), strict=True):
        box = sequence.boxes[index] if index < len(sequence.boxes) else absent
        try:
            row[:] = _look_at(sequence.image(index), box, context)
        except FrameUnreadable as error:
            if on_unreadable is None:
                raise
            on_unreadable(error)
            row[:] = np.nan
        if on_frame is not None:
            on_frame()
    return LightTrace(indices, *rows.T.copy())


def _look_at(image: Image, box: Box, context: float) -> tuple[float, ...]:
    small = resize_area(image, MEASURE_SIZE)  # once for three measures
    return (
        float(grey(small).mean()),
        light_spread(small),
        saturated_beside_dark(small),
        local_grey(image, box),
        local_grey(image, box, context),
        target_light_spread(image, box),
    )
