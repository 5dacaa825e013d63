"""Formats between which `convert` goes, one module each; see `common.Converter`."""

from nat2024.datasets.converters import coco_video, got10k, index, published, pysot
from nat2024.datasets.converters.common import Converter, Described

CONVERTERS: dict[str, Converter] = {
    index.FORMAT: index,
    published.FORMAT: published,
    got10k.FORMAT: got10k,
    pysot.FORMAT: pysot,
    coco_video.FORMAT: coco_video,
}
"""By the name of the format."""

__all__ = ["CONVERTERS", "Converter", "Described"]
