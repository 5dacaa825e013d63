"""What the page shows: plain tables and arrays that others computed.

Tables are pandas DataFrames with the columns of `Evaluation`; arrays have one value a frame. NaN
means "not known" everywhere and is drawn as a gap.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal, TypeAlias

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    import pandas as pd

Floats: TypeAlias = npt.NDArray[np.floating]
Box: TypeAlias = tuple[float, float, float, float]
"""x, y, w, h in pixels of the whole frame."""


@dataclass(frozen=True, slots=True)
class Run:
    """One tracker with one enhancer.

    Attributes:
        name: of its results folder.
        tracker: as tables show it.
        enhancer: "none" for the plain tracker.
        scope: what was enhanced, empty where nothing tells.
        frames_per_second: of enhancing and tracking, NaN where it was not timed.
    """

    name: str
    tracker: str
    enhancer: str = "none"
    scope: str = ""
    frames_per_second: float = np.nan


@dataclass(frozen=True, slots=True)
class Subset:
    """Scores over some sequences of a dataset: all, those of an attribute, those of a category.

    Attributes:
        kind: what joins them.
        name: of the attribute or category, empty for all.
        provenance: where the attribute comes from: "published", "computed", "manual" or "mixed".
        sequences: their names.
        summary: one row a run, columns `run` and the scores.
        curves: `run, metric, threshold, value`.
        gains: `run, base, metric, base_value, difference, difference_low, difference_high, gain,
            gain_low, gain_high, improved, sequences, certain`, gains in percent; None where none
            were computed.
        meaning: the name in full words, empty where it has none.
    """

    kind: Literal["all", "attribute", "category"]
    name: str
    provenance: str
    sequences: tuple[str, ...]
    summary: "pd.DataFrame"
    curves: "pd.DataFrame"
    gains: "pd.DataFrame | None" = None
    meaning: str = ""


@dataclass(frozen=True, slots=True)
class ProtocolScores:
    """Everything that one protocol says of a dataset.

    Attributes:
        title: its name with options.
        description: what it does, in one line.
        subsets: all sequences first.
        per_sequence: one row a run and sequence, columns `run`, `sequence` and the scores.
    """

    title: str
    description: str
    subsets: tuple[Subset, ...]
    per_sequence: "pd.DataFrame"


@dataclass(frozen=True, slots=True)
class Track:
    """How one run followed the target of one sequence.

    Attributes:
        overlap: (n,) in 0..1.
        center_error: (n,) in pixels.
        losses: 0-based frames where it lost the target, the first loss first.
    """

    overlap: Floats
    center_error: Floats
    losses: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class LightCurve:
    """One measure of light over some frames of a sequence.

    Attributes:
        title: its name.
        unit: in words, empty where it has none.
        frames: (m,) 0-based.
        levels: (m,).
    """

    title: str
    unit: str
    frames: npt.NDArray[np.integer]
    levels: Floats


@dataclass(frozen=True, slots=True)
class Thumbnail:
    """A small picture of one frame, on which the page draws boxes.

    Attributes:
        frame: 0-based.
        caption: why it is shown, such as "worst".
        jpeg: the encoded picture.
        window: the part of the frame that it shows, in pixels of the frame.
        truth: ground truth, None where there is none.
        boxes: by name of the run.
        run: for which run it was chosen; empty where for all.
    """

    frame: int
    caption: str
    jpeg: bytes
    window: Box
    truth: Box | None
    boxes: Mapping[str, Box]
    run: str = ""


@dataclass(frozen=True, slots=True)
class SequencePart:
    """One sequence.

    Attributes:
        name: of the sequence.
        frames: how many.
        category: what the target is, empty where nothing tells.
        attributes: provenance by name.
        tracks: by name of the run.
        light: measures over time.
        light_means: one number for each of the dataset's `light_measures` that is known.
        thumbnails: in the order in which they are shown.
    """

    name: str
    frames: int
    category: str = ""
    attributes: Mapping[str, str] = field(default_factory=dict)
    tracks: Mapping[str, Track] = field(default_factory=dict)
    light: tuple[LightCurve, ...] = ()
    light_means: Mapping[str, float] = field(default_factory=dict)
    thumbnails: tuple[Thumbnail, ...] = ()


@dataclass(frozen=True, slots=True)
class Column:
    """A column of a free table.

    Attributes:
        key: name in the table.
        heading: as people read it.
        decimals: of its numbers; None for words.
        hint: what it means, shown on hovering.
    """

    key: str
    heading: str
    decimals: int | None = None
    hint: str = ""


@dataclass(frozen=True, slots=True)
class FailureTable:
    """Losses of each run on each sequence.

    Attributes:
        columns: what is shown beside `run` and `sequence`.
        rows: with the columns `run`, `sequence` and those of `columns`.
    """

    columns: tuple[Column, ...]
    rows: "pd.DataFrame"


@dataclass(frozen=True, slots=True)
class DatasetPart:
    """One dataset.

    Attributes:
        name: of the dataset.
        runs: in the order of the tables.
        protocols: the main one first.
        sequences: in the order of the dataset.
        failures: None where none were analysed.
        light_measures: numbers that describe the light of a sequence; gains are drawn against them.
        remarks: what a reader must know beside the scores, one line each.
    """

    name: str
    runs: tuple[Run, ...]
    protocols: tuple[ProtocolScores, ...]
    sequences: tuple[SequencePart, ...]
    failures: FailureTable | None = None
    light_measures: tuple[Column, ...] = ()
    remarks: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Page:
    """The whole page.

    Attributes:
        title: its heading.
        datasets: at least one.
        remarks: what concerns all of them, one line each.
        made_by: program and version, for the foot of the page.
    """

    title: str
    datasets: tuple[DatasetPart, ...]
    remarks: tuple[str, ...] = ()
    made_by: str = "nat-bench"
