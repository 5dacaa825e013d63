"""What an enhancer gains over the plain tracker."""

import math


def relative_gain(value: float, base: float) -> float:
    """Gain in percent relative to the tracker alone, 100 (value - base) / base.

    As in the reference paper's Table IV: 0.434 against 0.372 is 16.667. NaN where the base is 0 or
    either is NaN.

    >>> round(relative_gain(0.434, 0.372), 3)
    16.667
    """
    return 100.0 * (value - base) / base if base else math.nan
