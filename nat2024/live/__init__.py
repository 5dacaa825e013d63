"""Tracking on one's own footage: a video, a folder of images, a camera or a stream.

The paper's real-world test. Boxes are told frame by frame, as they are found; nothing is scored
here and nothing drawn.
"""

from nat2024.live.film import Film
from nat2024.live.following import Arrival, LiveFrame, follow
from nat2024.live.recording import LiveSummary, Recorder, center_errors, summarise
from nat2024.live.sources import LiveSource, open_source

__all__ = [
    "Arrival",
    "Film",
    "LiveFrame",
    "LiveSource",
    "LiveSummary",
    "Recorder",
    "center_errors",
    "follow",
    "open_source",
    "summarise",
]
