"""Enhancing images, videos and datasets outside of tracking: what `nat-bench enhance` does."""

from nat2024.enhancing.feeding import Feed, compute_maps, enhance_unrounded
from nat2024.enhancing.pictures import Picture, read_picture
from nat2024.enhancing.reporting import (
    Enhanced,
    EnhancementReport,
    Failure,
    Observation,
    Observer,
)
from nat2024.enhancing.running import count_images, create_enhancers, enhance_images
from nat2024.enhancing.sources import ImageItem, Source, VideoItem, find_source

__all__ = [
    "Enhanced",
    "EnhancementReport",
    "Failure",
    "Feed",
    "ImageItem",
    "Observation",
    "Observer",
    "Picture",
    "Source",
    "VideoItem",
    "compute_maps",
    "count_images",
    "create_enhancers",
    "enhance_images",
    "enhance_unrounded",
    "find_source",
    "read_picture",
]
