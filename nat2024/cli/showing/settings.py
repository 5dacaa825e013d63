"""How `nat-bench show` is to show things, read from its options."""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from nat2024.cli.options import read_names
from nat2024.cli.showing.scenes import Shown, choose_frames
from nat2024.errors import UsageError
from nat2024.evaluation import Evaluation
from nat2024.types import closest

_FORMATS = ("pdf", "svg", "png")


@dataclass(frozen=True, slots=True)
class Settings:
    """What the options say.

    Attributes:
        forms: of "strip", "video" and "frames".
        out: folder that everything is written to.
        endings: of the files of a strip.
        video_format: "webm" or "mp4".
        rate: frames a second of a video.
        count: frames of a strip.
        frames: of a strip, empty for the most telling ones.
        span: first and last frame of a video; None for all.
        enhanced: whether enhanced frames are shown; None for in strips only.
        whole: show whole frames in strips.
        inset: magnify the target in videos.
        device: where enhancers run.
    """

    forms: tuple[str, ...]
    out: Path
    endings: tuple[str, ...]
    video_format: str
    rate: float
    count: int
    frames: tuple[int, ...]
    span: tuple[int, int] | None
    enhanced: bool | None
    whole: bool
    inset: bool
    device: str

    @property
    def enhances(self) -> bool:
        """Whether enhanced frames are shown anywhere."""
        return bool(self.enhanced) or (self.enhanced is None and "strip" in self.forms)

    def for_video(self, shown: Shown) -> Shown:
        """What a video shows: enhanced frames only where they are asked for."""
        return shown if self.enhanced else replace(shown, enhancers={})

    def strip_frames(self, shown: Shown) -> list[tuple[int, str, str]]:
        """Number, reason and run of each frame of a strip.

        Raises:
            UsageError: a frame that the sequence does not have.
        """
        length = shown.evidence.length
        for frame in self.frames:
            if not 0 <= frame < length:
                msg = f"--frame {frame}: {shown.sequence.name} has frames 0 to {length - 1}"
                raise UsageError(msg)
        if self.frames:
            reasons = {frame: moment for frame, moment in shown.moments}
            return [
                (f, ", ".join(reasons[f].reasons), reasons[f].run) if f in reasons else (f, "", "")
                for f in self.frames
            ]
        tracks = shown.evidence.tracks.values()
        known = {int(f) for t in tracks for f in t.frames[~np.isnan(t.overlap)]}
        return choose_frames(
            shown.moments, known or {int(f) for t in tracks for f in t.frames}, self.count
        )

    def video_frames(self, shown: Shown) -> range:
        """Numbers of the frames of a video.

        Raises:
            UsageError: the sequence has none of them.
        """
        length = shown.evidence.length
        if self.span is None:
            return range(length)
        first, last = self.span
        if first >= length:
            msg = f"--range {first}:{last}: {shown.sequence.name} has frames 0 to {length - 1}"
            raise UsageError(msg)
        return range(first, min(last, length - 1) + 1)

    def frames_of(self, form: str, shown: Shown) -> int:
        """How many frames one form of a sequence takes."""
        chosen = self.strip_frames(shown) if form == "strip" else self.video_frames(shown)
        return len(chosen)


def read_settings(forms: Iterable[str], device: str, given: Mapping[str, Any]) -> Settings:
    """Check and gather the options.

    Raises:
        UsageError: one is of the wrong form or value.
    """
    formats = read_names([given["formats"]])
    if not formats or not set(formats) <= set(_FORMATS):
        msg = f"--format {given['formats']!r}: expected some of {', '.join(_FORMATS)}"
        raise UsageError(msg)
    if given["count"] < 1 or given["rate"] <= 0:
        msg = "--count takes at least 1 frame, --rate more than 0 frames a second"
        raise UsageError(msg)
    return Settings(
        forms=tuple(dict.fromkeys(forms)),
        out=given["out"],
        endings=tuple(f".{name}" for name in formats),
        video_format=given["video_format"],
        rate=given["rate"],
        count=given["count"],
        frames=_read_numbers(given["frames"]),
        span=_read_span(given["span"]),
        enhanced=given["enhanced"],
        whole=given["whole"],
        inset=given["inset"],
        device=device,
    )


def _read_numbers(texts: Iterable[str]) -> tuple[int, ...]:
    try:
        return tuple(sorted({int(text) for text in read_names(texts)}))
    except ValueError:
        msg = f"--frame {','.join(texts)!r}: expected numbers of frames, counted from 0"
        raise UsageError(msg) from None


def _read_span(text: str | None) -> tuple[int, int] | None:
    if text is None:
        return None
    first, colon, last = text.partition(":")
    try:
        found = int(first or 0), int(last) if last else 2**31
    except ValueError:
        found = (-1, -1)
    if not colon or found[0] < 0 or found[1] < found[0]:
        msg = f"--range {text!r}: expected FIRST:LAST, counted from 0, such as 40:80"
        raise UsageError(msg)
    return found


def check_runs(runs: Collection[str], evaluations: Iterable[Evaluation]) -> None:
    """Refuse runs that no evaluation has.

    Raises:
        UsageError: such a run; names the closest.
    """
    known = list(dict.fromkeys(run.run for one in evaluations for run in one.runs))
    for run in runs:
        if run not in known:
            there = closest(run, known) or f"; there are {', '.join(known[:12])}"
            msg = f"--run {run!r}: not in these results{there}"
            raise UsageError(msg)
