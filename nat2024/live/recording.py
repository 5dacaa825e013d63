"""What is kept of a run on one's own footage, written line by line as it comes."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import IO

import numpy as np

from nat2024.boxes import format_boxes
from nat2024.errors import Unwritable
from nat2024.files import remove_leftovers
from nat2024.live.following import LiveFrame
from nat2024.metrics import center_error
from nat2024.types import Boxes, Floats

BOX_FILE, FRAME_FILE = "boxes.txt", "frames.csv"
_HEADING = "frame,skipped,score,read,enhance,track\n"


class Recorder:
    """Writes `boxes.txt` and `frames.csv` in a folder; use it in a `with` block.

    Every frame is on the disk before the next is tracked, so that nothing is lost when the run is
    ended by whatever means. A box line is `x,y,w,h`; a line of `frames.csv` has the frame's number
    in the source, 1 where it was skipped, the score (empty where there is none) and the seconds of
    each stage.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._files: tuple[IO[str], ...] = ()

    def __enter__(self) -> "Recorder":
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            remove_leftovers(self._folder)  # such as the video of a run that was killed
            names = (self._folder / BOX_FILE, self._folder / FRAME_FILE)
            self._files = tuple(path.open("w", encoding="ascii", newline="") for path in names)
        except OSError as error:
            msg = f"{self._folder}: cannot be written ({error.strerror or error})"
            raise Unwritable(msg) from None
        self._files[1].write(_HEADING)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        for file in self._files:
            file.close()

    def write(self, frame: LiveFrame) -> None:
        """Write the lines of one frame."""
        score = "" if np.isnan(frame.score) else f"{frame.score:.6g}"
        seconds = ",".join(f"{second:.6f}" for second in frame.seconds)
        lines = (
            format_boxes(frame.box[None]),
            f"{frame.index},{int(frame.is_skipped)},{score},{seconds}\n",
        )
        try:
            for file, line in zip(self._files, lines, strict=True):
                file.write(line)
                file.flush()
        except OSError as error:
            msg = f"{self._folder}: cannot be written ({error.strerror or error})"
            raise Unwritable(msg) from None


@dataclass(frozen=True, slots=True)
class LiveSummary:
    """What a run comes to; the start frame is left out of all times.

    Attributes:
        frames: of the source, skipped ones included.
        skipped: how many the tracker never saw.
        frames_per_second: frames seen in each second of reading, enhancing and tracking.
        method_frames_per_second: frames seen in each second of enhancing and tracking.
        read_ms: median of a frame seen, like the next two.
        enhance_ms: median.
        track_ms: median.
        compared: frames whose reference box is known.
        precision_20: share of these with a centre within 20 pixels; NaN without reference.
        mean_center_error: of these, in pixels; NaN without reference.
    """

    frames: int
    skipped: int
    frames_per_second: float
    method_frames_per_second: float
    read_ms: float
    enhance_ms: float
    track_ms: float
    compared: int
    precision_20: float
    mean_center_error: float


def summarise(frames: Sequence[LiveFrame], reference: Boxes | None = None) -> LiveSummary:
    """Sum a run up.

    Args:
        frames: as `follow` gave them (their images are not needed).
        reference: box of each frame of the source, NaN where there is none.
    """
    seconds = np.array([f.seconds for f in frames[1:] if not f.is_skipped]).reshape(-1, 3)
    medians = np.median(seconds, axis=0) * 1000 if len(seconds) else np.full(3, np.nan)
    errors = center_errors(frames, reference)
    known = errors[np.isfinite(errors)]
    return LiveSummary(
        frames=len(frames),
        skipped=sum(f.is_skipped for f in frames),
        frames_per_second=_rate(seconds),
        method_frames_per_second=_rate(seconds[:, 1:]),
        read_ms=float(medians[0]),
        enhance_ms=float(medians[1]),
        track_ms=float(medians[2]),
        compared=len(known),
        precision_20=float((known <= 20).mean()) if len(known) else float("nan"),
        mean_center_error=float(known.mean()) if len(known) else float("nan"),
    )


def center_errors(frames: Sequence[LiveFrame], reference: Boxes | None) -> Floats:
    """Centre location error of each frame in pixels, NaN where no reference box is known."""
    truth = np.full((len(frames), 4), np.nan)
    for row, frame in enumerate(frames):
        if reference is not None and frame.index < len(reference):
            truth[row] = reference[frame.index]
    boxes = np.array([frame.box for frame in frames]).reshape(-1, 4)
    return center_error(boxes, truth)


def _rate(seconds: Floats) -> float:
    total = float(seconds.sum())
    return len(seconds) / total if total > 0 else float("nan")
