"""Night video made by code, with exact ground truth."""

from nat2024.night.clip import Clip, render_clip

__all__ = ["Clip", "render_clip"]
