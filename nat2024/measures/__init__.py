"""Numbers that describe the light in one image; arrays in, numbers out."""

from nat2024.measures.night import MEASURE_SIZE, NIGHT_MEASURES, night_statistics
from nat2024.measures.pixels import block_statistics, grey, resize_area

__all__ = [
    "MEASURE_SIZE",
    "NIGHT_MEASURES",
    "block_statistics",
    "grey",
    "night_statistics",
    "resize_area",
]
