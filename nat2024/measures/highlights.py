"""Over-enhancement as one number: how far what was already bright is pushed to white."""

import numpy as np

from nat2024.measures.fidelity import check_pair
from nat2024.measures.night import BRIGHT_LEVEL, SATURATION_LEVEL
from nat2024.measures.pixels import grey
from nat2024.types import Image


def over_enhancement(before: Image, after: Image) -> float:
    """Share of the way to white that an enhancer pushed the pixels that were bright before.

    The mean of max(0, after - before) / (1 - before) over pixels whose grey level was above 0.7 but
    not saturated (0.97): 0 where lamps are spared, 1 where all they lit becomes white. Unlike the
    mean rise it does not depend on how bright they were.

    Args:
        before: uint8 (H, W, 3) in any channel order.
        after: the enhanced image, of the same size and channel order.

    Returns:
        In 0..1; NaN where no pixel was bright, so that nothing could be over-enhanced.

    Raises:
        ArrayContract: one is no uint8 image of shape (H, W, 3), or sizes differ.
    """
    check_pair(before, after, "enhanced image")
    levels, new_levels = grey(before), grey(after)
    bright = (levels > BRIGHT_LEVEL) & (levels < SATURATION_LEVEL)
    if not bright.any():
        return float("nan")
    rise = np.maximum(new_levels - levels, 0.0)[bright]
    return float((rise / (1 - levels[bright])).mean())
