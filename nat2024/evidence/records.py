"""What is gathered; the module docstring of the package explains each entry."""

import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from nat2024.analysis import Failure, LightTrace
from nat2024.types import Boxes, Floats

if TYPE_CHECKING:
    import pandas as pd

Corners = tuple[float, float, float, float]
"""x, y, w, h in pixels of a thumbnail."""


@dataclass(frozen=True, slots=True)
class LossEvidence:
    """The light where a run first lost its target; NaN where it is not known.

    Attributes:
        frame: 0-based number.
        luminance: mean grey level of the target's box enlarged twice, 0..255.
        unevenness: spread of light around the target in stops.
        over_enhancement: of the region where the tracker searched, 0..1
            (`nat2024.measures.over_enhancement`).
    """

    frame: int
    luminance: float
    unevenness: float
    over_enhancement: float


@dataclass(frozen=True, slots=True, eq=False)
class TrackEvidence:
    """One run on one sequence.

    Attributes:
        run: name of its folder.
        tracker: as in the evaluation.
        enhancer: likewise, "none" for the plain tracker.
        frames: int (n,), 0-based numbers of the scored frames.
        boxes: float64 (n, 4), the tracker's; NaN rows where it gave none.
        overlap: float64 (n,).
        center_error: float64 (n,), pixels.
        failure: where it lost the target.
        at_loss: the light there, None where it never did.
    """

    run: str
    tracker: str
    enhancer: str
    frames: npt.NDArray[np.intp]
    boxes: Boxes
    overlap: Floats
    center_error: Floats
    failure: Failure
    at_loss: LossEvidence | None = None

    @property
    def first_loss(self) -> int | None:
        """0-based number of the frame where the first loss begins."""
        row = self.failure.first_loss
        return None if row is None else int(self.frames[row])

    def row_of(self, frame: int) -> int | None:
        """Row of a frame in the arrays, None where it is not scored."""
        row = int(np.searchsorted(self.frames, frame))
        return row if row < len(self.frames) and self.frames[row] == frame else None

    def box_at(self, frame: int) -> Floats | None:
        """The box at a frame, None where there is no usable one."""
        row = self.row_of(frame)
        if row is None or not np.isfinite(self.boxes[row]).all():
            return None
        box: Floats = self.boxes[row]
        return box


@dataclass(frozen=True, slots=True)
class Thumbnail:
    """A part of a frame around the target, with boxes as numbers.

    Attributes:
        frame: 0-based number.
        reasons: why this frame.
        run: the run that it is about, empty where all are meant.
        jpeg: the picture.
        width: of the picture.
        height: of the picture.
        truth: in pixels of the picture, None where not known.
        boxes: of each run that has one; may lie outside.
    """

    frame: int
    reasons: tuple[str, ...]
    run: str
    jpeg: bytes
    width: int
    height: int
    truth: Corners | None
    boxes: dict[str, Corners]


@dataclass(frozen=True, slots=True, eq=False)
class SequenceEvidence:
    """One sequence and all runs on it.

    Attributes:
        name: of the sequence.
        length: number of its frames.
        truth: float64 (length, 4), NaN where not known.
        tracks: by run.
        light: of the frames that were looked at, None without images.
        thumbnails: in the order of frames, empty without images.
    """

    name: str
    length: int
    truth: Boxes
    tracks: Mapping[str, TrackEvidence]
    light: LightTrace | None = None
    thumbnails: tuple[Thumbnail, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Evidence:
    """All that was gathered of one dataset.

    Attributes:
        dataset: its name.
        sequences: those that any run has, in dataset order.
        notes: what could not be gathered, one line each.
        loss_frames: frames without overlap in a row that make a loss.
    """

    dataset: str
    sequences: tuple[SequenceEvidence, ...]
    notes: tuple[str, ...] = ()
    loss_frames: int = 0

    def __getitem__(self, name: str) -> SequenceEvidence:
        """The evidence of a sequence; `KeyError` where there is none."""
        for sequence in self.sequences:
            if sequence.name == name:
                return sequence
        raise KeyError(name)

    def __contains__(self, name: object) -> bool:
        """Whether there is evidence of a sequence of that name."""
        return any(sequence.name == name for sequence in self.sequences)

    def failures(self) -> "pd.DataFrame":
        """One row a run and sequence; the package explains the columns."""
        import pandas as pd

        rows = [_failure_row(s.name, t) for s in self.sequences for t in s.tracks.values()]
        frame = pd.DataFrame(rows, columns=list(_FAILURE_COLUMNS))
        return frame.astype({"first_loss": "Int64"})

    def light(self) -> "pd.DataFrame":
        """One row a sequence with images; the package explains the columns."""
        import pandas as pd

        rows = [_light_row(s.name, s.light) for s in self.sequences if s.light is not None]
        return pd.DataFrame(rows, columns=list(LIGHT_COLUMNS))


_FAILURE_COLUMNS = (
    "run",
    "tracker",
    "enhancer",
    "sequence",
    "frames",
    "absent",
    "first_loss",
    "losses",
    "lost",
    "recoveries",
    "drift",
    "longest",
    "luminance_at_loss",
    "unevenness_at_loss",
    "over_enhancement_at_loss",
)
LIGHT_COLUMNS = (
    "sequence",
    "frames",
    "luminance",
    "unevenness",
    "target_luminance",
    "target_unevenness",
)


def _failure_row(sequence: str, track: TrackEvidence) -> dict[str, Any]:
    failure, loss = track.failure, track.at_loss
    nan = float("nan")
    return {
        "run": track.run,
        "tracker": track.tracker,
        "enhancer": track.enhancer,
        "sequence": sequence,
        "frames": failure.frames,
        "absent": failure.absent,
        "first_loss": track.first_loss,
        "losses": failure.losses,
        "lost": failure.lost,
        "recoveries": failure.recoveries,
        "drift": failure.drift,
        "longest": failure.longest,
        "luminance_at_loss": loss.luminance / 255 if loss else nan,
        "unevenness_at_loss": loss.unevenness if loss else nan,
        "over_enhancement_at_loss": loss.over_enhancement if loss else nan,
    }


def _light_row(sequence: str, light: LightTrace) -> dict[str, Any]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # a target that is never there
        return {
            "sequence": sequence,
            "frames": int(np.isfinite(light.mean).sum()),
            "luminance": float(np.nanmedian(light.mean)),
            "unevenness": float(np.nanmedian(light.spread)),
            "target_luminance": float(np.nanmedian(light.target)) / 255,
            "target_unevenness": float(np.nanmedian(light.target_spread)),
        }
