"""Night video made by code, with exact ground truth."""

from nat2024.night.clip import Clip, render_clip
from nat2024.night.darkening import Darkening
from nat2024.night.sequence import NightFrame, NightSequence, NightSettings, Truth, attributes

__all__ = [
    "Clip",
    "Darkening",
    "NightFrame",
    "NightSequence",
    "NightSettings",
    "Truth",
    "attributes",
    "render_clip",
]
