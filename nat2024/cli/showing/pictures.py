"""Strips, videos and single frames of what is shown."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from nat2024.cli.showing.scenes import ORIGINAL, Shown
from nat2024.errors import FrameUnreadable
from nat2024.types import Image

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from nat2024_reports.figures.strips import StripFrame, Timeline
    from nat2024_reports.video_frames import Scene


def draw_strip(
    shown: Shown,
    frames: Iterable[tuple[int, str, str]],
    *,
    whole: bool,
    title: str,
    on_frame: Callable[[], object],
) -> "Figure | None":
    """A strip of these frames (number, reason, run); None where none of them can be read."""
    from nat2024_reports.figures.strips import strip_figure

    columns = []
    for frame, reason, run in frames:
        label = shown.looks[run].label if run in shown.looks else ""
        columns.append(_column(shown, frame, reason, label))
        on_frame()
    if all(image is None for column in columns for image in column.images):
        return None
    rows = [ORIGINAL, *shown.enhancers]
    return strip_figure(
        columns,
        shown.looks,
        rows=rows if shown.enhancers else [""],
        title=title,
        whole=whole,
        timeline=_timeline(shown),
    )


def _column(shown: Shown, frame: int, reason: str, about: str) -> "StripFrame":
    from nat2024_reports.figures.strips import StripFrame

    truth = shown.evidence.truth[frame]
    tracks = shown.evidence.tracks.items()
    return StripFrame(
        frame=frame,
        reason=reason,
        about=about,
        images=tuple(shown.images(frame).values()),
        truth=truth if np.isfinite(truth).all() else None,
        boxes={run: box for run, t in tracks if (box := t.box_at(frame)) is not None},
    )


def _timeline(shown: Shown) -> "Timeline":
    from nat2024_reports.figures.strips import Timeline

    tracks = shown.evidence.tracks
    return Timeline(
        {run: track.frames for run, track in tracks.items()},
        {run: track.overlap for run, track in tracks.items()},
    )


def film_frames(
    shown: Shown, frames: Iterable[int], *, inset: bool
) -> "Iterator[tuple[int, Image]]":
    """Number and picture of each frame, all of one even size."""
    from nat2024_reports.video_frames import video_frame

    size = frame_size(shown)
    for frame in frames:
        yield frame, video_frame(_scene(shown, frame), shown.looks, size, inset=inset)


def frame_size(shown: Shown) -> tuple[int, int]:
    """(width, height) of the first frame that can be read.

    Raises:
        FrameUnreadable: there is none.
    """
    try:
        return shown.sequence.frame_size
    except FrameUnreadable:
        for frame in range(len(shown.sequence)):
            image = shown.images(frame)[ORIGINAL]
            if image is not None:
                return image.shape[1], image.shape[0]
        raise


def _scene(shown: Shown, frame: int) -> "Scene":
    from nat2024_reports.video_frames import Scene

    truth = shown.evidence.truth[frame]
    overlaps = {}
    for run, track in shown.evidence.tracks.items():
        row = track.row_of(frame)
        overlaps[run] = float("nan") if row is None else float(track.overlap[row])
    images = shown.images(frame)
    return Scene(
        number=frame,
        panels=images if shown.enhancers else {"": images[ORIGINAL]},
        truth=truth if np.isfinite(truth).all() else None,
        boxes={run: track.box_at(frame) for run, track in shown.evidence.tracks.items()},
        overlaps=overlaps,
    )


def write_video(path: Path, pictures: Iterator[tuple[int, Image]], rate: float) -> int:
    """Write a video, WebM or MP4 by the ending of its path; gives the number of frames.

    Raises:
        Unwritable: it cannot be written, or MP4 lacks the extra that it needs.
    """
    from nat2024.datasets.mp4_writing import MP4_ENDING, Mp4File
    from nat2024.datasets.video_writing import VideoFile

    kind = Mp4File if path.suffix == MP4_ENDING else VideoFile
    count = 0
    with closing(pictures):  # type: ignore[type-var]
        first = next(pictures, None)
        if first is None:
            return 0
        height, width = first[1].shape[:2]
        with kind(path, (width, height), rate) as video:
            video.write(first[1])
            count = 1
            for _, picture in pictures:
                video.write(picture)
                count += 1
    return count


def write_frames(folder: Path, pictures: Iterable[tuple[int, Image]]) -> list[Path]:
    """Write each picture as `NUMBER.png`; gives the paths."""
    import cv2

    from nat2024.files import write_atomic

    paths = []
    for number, picture in pictures:
        _, encoded = cv2.imencode(".png", picture)
        paths.append(folder / f"{number:05d}.png")
        write_atomic(paths[-1], encoded.tobytes())
    return paths
