"""What a dataset holds: what `nat-bench dataset info` shows."""

import os
from collections import Counter

import msgspec
import numpy as np

from nat2024.datasets.frames import count_frames
from nat2024.datasets.reading import ReadSequence, attribute_names, locate, read_sequences
from nat2024.datasets.recognition import recognise
from nat2024.datasets.registered import FirstBox, is_registered, registered_dataset
from nat2024.errors import FrameUnreadable
from nat2024.types import Boxes, Dataset, Sequence


class SequenceInfo(msgspec.Struct, frozen=True, kw_only=True):
    """What one sequence holds.

    Attributes:
        name: of the sequence.
        frames: number of images.
        width: of the first frame in pixels, 0 where it cannot be read.
        height: of the first frame in pixels, 0 where it cannot be read.
        annotated: frames with a row of boxes.
        keyframes: whether only some frames were meant to have one.
        first_box: x, y, w, h of the first frame; None without annotation there.
        absent: rows with a value that is no finite number: the target is absent.
        zero_size: rows with a width or height that is not above 0.
        attributes: abbreviations, sorted.
        problem: why it cannot be loaded, empty where it can.
        category: what the target is, empty where nothing tells.
        activity: what it does, empty where nothing tells.
    """

    name: str
    frames: int
    width: int = 0
    height: int = 0
    annotated: int = 0
    keyframes: bool = False
    first_box: FirstBox | None = None
    absent: int = 0
    zero_size: int = 0
    attributes: tuple[str, ...] = ()
    problem: str = ""
    category: str = ""
    activity: str = ""


class DatasetInfo(msgspec.Struct, frozen=True, kw_only=True):
    """What a dataset holds; totals are over all its sequences.

    Attributes:
        name: registered name, or base name of the folder.
        title: name as papers write it, empty where neither published facts nor an index tell.
        recognised_as: the registered dataset that names and lengths say it is, or empty.
        layout: the folder layout in words.
        root: the folder.
        frames: number of images.
        shortest: frames of the shortest sequence.
        longest: frames of the longest sequence.
        mean_length: frames a sequence.
        annotated: names of sequences with a box for every frame.
        keyframed: names of sequences with boxes of some frames.
        unannotated: names of sequences without boxes.
        attributes: number of sequences by attribute, in published order.
        paper: where it was published.
        licence: of frames and ground truth.
        problems: what keeps sequences from being loaded.
        sequences: one by one, sorted by name.
    """

    name: str
    title: str
    recognised_as: str
    layout: str
    root: str
    frames: int
    shortest: int
    longest: int
    mean_length: float
    annotated: tuple[str, ...]
    keyframed: tuple[str, ...]
    unannotated: tuple[str, ...]
    attributes: dict[str, int]
    paper: str
    licence: str
    problems: tuple[str, ...]
    sequences: tuple[SequenceInfo, ...]


def describe(
    dataset: str | os.PathLike[str] | Dataset, root: str | os.PathLike[str] | None = None
) -> DatasetInfo:
    """Say what a dataset holds, sequences without annotation included.

    Faulty sequences are described and named in `problems`, nothing is raised for them.

    Args:
        dataset: a registered name, a folder, or a loaded dataset (of which only the loaded
            sequences are described).
        root: as in `load_dataset`.

    Raises:
        DatasetNotFound, DatasetIncomplete, UsageError: as `load_dataset`, but for faults of single
            sequences.
    """
    if isinstance(dataset, Dataset):
        sequences = tuple(describe_sequence(sequence) for sequence in dataset.sequences)
        published_as = dataset.name if is_registered(dataset.name) else recognise(dataset).name
        return _sum_up(dataset, published_as, recognise(dataset).name, sequences)
    place = locate(dataset, root)
    read = read_sequences(place)
    names = attribute_names(read, place)
    loaded = Dataset(place.name, (), place.folder, place.layout.words, (), names)
    found = tuple(_describe_read(r) for r in read)
    summed = _sum_up(loaded, place.published_as, place.recognition.name, found)
    document = place.layout.document
    if document is None:
        return summed
    return msgspec.structs.replace(
        summed,
        title=document.title or summed.title,
        paper=document.citation or summed.paper,
        licence=document.licence or summed.licence,
    )


def describe_sequence(sequence: Sequence, problem: str = "") -> SequenceInfo:
    """Say what one sequence holds; reads the header of its first frame."""
    width, height = 0, 0
    frames = count_frames(sequence.frames)
    try:
        width, height = sequence.frame_size
    except FrameUnreadable as error:
        problem = problem or str(error)
    rows = sequence.boxes
    if sequence.keyframes is not None:
        rows = rows[sequence.keyframes]
    return SequenceInfo(
        name=sequence.name,
        frames=frames,
        width=width,
        height=height,
        annotated=len(rows),
        keyframes=sequence.keyframes is not None,
        first_box=_first_box(sequence.boxes),
        absent=int((~np.isfinite(rows).all(axis=1)).sum()),
        zero_size=int((rows[:, 2:] <= 0).any(axis=1).sum()),
        attributes=tuple(sorted(sequence.attributes)),
        problem=problem,
        category=sequence.category,
        activity=sequence.activity,
    )


def _describe_read(read: ReadSequence) -> SequenceInfo:
    frames = read.found.frames
    fault = str(read.fault) if read.fault else ""
    whole = Sequence(
        read.name,
        frames,
        read.boxes,
        read.visible,
        read.attributes,
        read.keyframes,
        read.category,
        read.activity,
    )
    return describe_sequence(whole, fault)


def _first_box(boxes: Boxes) -> FirstBox | None:
    if not len(boxes) or not np.isfinite(boxes[0]).all():
        return None
    x, y, w, h = boxes[0].tolist()
    return x, y, w, h


def _sum_up(
    dataset: Dataset, published_as: str, recognised_as: str, found: tuple[SequenceInfo, ...]
) -> DatasetInfo:
    facts = registered_dataset(published_as) if published_as else None
    lengths = [s.frames for s in found]
    counts = Counter(attribute for s in found for attribute in s.attributes)
    return DatasetInfo(
        name=dataset.name,
        title=facts.title if facts else "",
        recognised_as=recognised_as,
        layout=dataset.layout,
        root=str(dataset.root or ""),
        frames=sum(lengths),
        shortest=min(lengths, default=0),
        longest=max(lengths, default=0),
        mean_length=sum(lengths) / len(lengths) if lengths else 0.0,
        annotated=tuple(s.name for s in found if s.annotated and not s.keyframes),
        keyframed=tuple(s.name for s in found if s.keyframes),
        unannotated=tuple(s.name for s in found if not s.annotated),
        attributes={name: counts[name] for name in dataset.attribute_names},
        paper=facts.paper if facts else "",
        licence=facts.licence if facts else "",
        problems=tuple(s.problem for s in found if s.problem),
        sequences=found,
    )
