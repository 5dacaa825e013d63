"""Numbers that describe the light in one image; arrays in, numbers out."""

from nat2024.measures.highlights import over_enhancement
from nat2024.measures.light import (
    TARGET_CONTEXT,
    UNEVEN_LIGHT_STOPS,
    cell_light,
    light_spread,
    local_grey,
    saturated_beside_dark,
    target_light_spread,
)
from nat2024.measures.night import MEASURE_SIZE, NIGHT_MEASURES, night_statistics
from nat2024.measures.pixels import block_statistics, grey, resize_area

__all__ = [
    "MEASURE_SIZE",
    "NIGHT_MEASURES",
    "TARGET_CONTEXT",
    "UNEVEN_LIGHT_STOPS",
    "block_statistics",
    "cell_light",
    "grey",
    "light_spread",
    "local_grey",
    "night_statistics",
    "over_enhancement",
    "resize_area",
    "saturated_beside_dark",
    "target_light_spread",
]
