"""From a name or path to sequences with their annotation; every fault kept beside its sequence.

`load_dataset` raises on these faults, `describe` and `validate` report them.
"""

import os
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from nat2024.boxes import read_boxes
from nat2024.datasets.annotations import read_attributes, read_keyframes, read_visible
from nat2024.datasets.layouts import FoundSequence, Layout, find_layout, find_layouts, only_layout
from nat2024.datasets.listings import path_kind
from nat2024.datasets.recognition import Recognition, recognise_layout
from nat2024.datasets.registered import (
    DatasetFacts,
    is_registered,
    list_datasets,
    registered_dataset,
)
from nat2024.datasets.roots import find_root, how_to_get
from nat2024.errors import DatasetIncomplete, DatasetNotFound, NatBenchError, UsageError
from nat2024.types import Boxes, Flags, Sequence, closest

SAMPLE = "night_mini"


@dataclass(frozen=True, slots=True)
class Place:
    """A dataset that was found but not read.

    Attributes:
        name: registered name, or base name of the folder.
        registered: whether it was asked for by its registered name.
        folder: the folder that was asked for or configured.
        layout: how the folder is laid out.
        recognition: which registered dataset names and lengths say it is.
    """

    name: str
    registered: bool
    folder: Path
    layout: Layout
    recognition: Recognition

    @property
    def published_as(self) -> str:
        """Registered name of the dataset, as asked for or as recognised; empty where neither."""
        return self.name if self.registered else self.recognition.name

    @property
    def facts(self) -> DatasetFacts | None:
        """What is published about it, None where nothing is."""
        return registered_dataset(self.published_as) if self.published_as else None


@dataclass(frozen=True, slots=True)
class ReadSequence:
    """One sequence with its annotation, or with what is wrong with it.

    Attributes:
        found: where it lies.
        boxes: as in `Sequence`, as many rows as the file has; (0, 4) without annotation.
        keyframes: as in `Sequence`.
        visible: as in `Sequence`.
        attributes: as in `Sequence`.
        fault: why it cannot be used, None where it can.
        attribute_fault: why its attribute file cannot be used, empty where it can.
    """

    found: FoundSequence
    boxes: Boxes
    keyframes: npt.NDArray[np.intp] | None = None
    visible: Flags | None = None
    attributes: frozenset[str] = frozenset()
    fault: NatBenchError | None = None
    attribute_fault: str = ""

    @property
    def name(self) -> str:
        """Name of the sequence."""
        return self.found.name

    @property
    def has_boxes(self) -> bool:
        """Whether a file gives a box for every frame, however well."""
        return self.found.boxes is not None

    @property
    def lengths_differ(self) -> bool:
        """Whether boxes and images are both there but differ in number."""
        return 0 < len(self.boxes) != len(self.found.frames) > 0

    def sequence(self) -> Sequence:
        """The sequence; boxes and images are cut to the shorter where they differ in number."""
        frames, visible = self.found.frames, self.visible
        if self.lengths_differ:
            count = min(len(self.boxes), len(frames))
            frames = frames.cut(count)
            visible = None if visible is None else visible[:count]
        boxes = self.boxes[: len(frames)]
        return Sequence(self.name, frames, boxes, visible, self.attributes, self.keyframes)


def locate(name_or_path: str | os.PathLike[str], root: str | os.PathLike[str] | None) -> Place:
    """Find a dataset by registered name or path and recognise it; nothing is read yet.

    Raises:
        DatasetNotFound: no such name and no such folder, or the folder is no dataset.
        DatasetIncomplete: the folder holds several datasets, or another one than was asked for.
        UsageError: a root was given for a path, or the configuration file is wrong.
    """
    if isinstance(name_or_path, str) and is_registered(name_or_path):
        return _locate_registered(name_or_path, root)
    if root is not None:
        msg = f"root={root} belongs to a registered dataset, but {name_or_path} is a folder"
        raise UsageError(msg)
    folder = Path(name_or_path).expanduser()
    if path_kind(folder) == "absent":
        raise DatasetNotFound(_unknown(str(name_or_path)))
    layout = find_layout(folder)
    name = folder.resolve().name or "dataset"
    return Place(name, False, folder, layout, recognise_layout(layout))


def _locate_registered(name: str, root: str | os.PathLike[str] | None) -> Place:
    folder = find_root(name, root)
    try:
        layouts = find_layouts(folder)
    except DatasetNotFound as error:
        msg = f"dataset {name}: {error}. {how_to_get(name)}"
        raise DatasetNotFound(msg) from None
    places = [Place(name, True, folder, x, recognise_layout(x)) for x in layouts]
    fitting = [place for place in places if place.recognition.name == name]
    if len(fitting) == 1:
        return fitting[0]
    only_layout(folder, layouts)
    _refuse_another(places[0])
    return places[0]


def _refuse_another(place: Place) -> None:
    """Raise where a folder agrees better with another registered dataset than with its own."""
    agreements = {c.name: c.equal for c in place.recognition.candidates}
    other = place.recognition.name
    published = registered_dataset(place.name).sequences
    if other and published and agreements.get(place.name, 0) < agreements.get(other, 0):
        msg = f"dataset {place.name}: {place.folder} holds {other} instead, by names and lengths"
        raise DatasetIncomplete(msg)


def _unknown(name: str) -> str:
    if name == SAMPLE:
        return (
            f"the sample {SAMPLE} is not part of this version; "
            "`nat-bench dataset synthesize FOLDER` renders a night clip with exact boxes"
        )
    if os.sep in name or "/" in name:
        return f"{name}: no such folder"
    near = closest(name.lower().replace("-", "_"), list_datasets())
    return f"{name!r} is neither a registered dataset nor a folder{near}"


def read_sequences(place: Place) -> list[ReadSequence]:
    """Read the annotation of every sequence; faults are kept, never raised."""
    return [read_sequence(found, place.facts) for found in place.layout.sequences]


def read_sequence(found: FoundSequence, facts: DatasetFacts | None) -> ReadSequence:
    """Read the annotation of one sequence; a fault is kept, never raised."""
    read = ReadSequence(found, np.empty((0, 4)))
    try:
        read = _read(found, read)
    except NatBenchError as error:
        return replace(read, fault=error)
    return _with_attributes(read, facts)


def _read(found: FoundSequence, read: ReadSequence) -> ReadSequence:
    images = len(found.frames)
    if not images:
        msg = f"{found.name}: no images in {found.frames.folder}"
        raise DatasetIncomplete(msg)
    visible = read_visible(found.folder, found.side_files, images)
    read = replace(read, visible=visible)
    if found.boxes is not None:
        boxes = read_boxes(found.boxes)
        fault = None
        if len(boxes) != images:
            msg = f"{found.name}: {len(boxes)} boxes in {found.boxes} but {images} images"
            fault = DatasetIncomplete(msg)
        return replace(read, boxes=boxes, fault=fault)
    if found.keyframes is not None:
        boxes, keyframes = read_keyframes(found.keyframes, images)
        return replace(read, boxes=boxes, keyframes=keyframes)
    return read


def _with_attributes(read: ReadSequence, facts: DatasetFacts | None) -> ReadSequence:
    if facts is None:
        return read
    labels = frozenset(a for a, names in facts.labels.items() if read.name in names)
    if read.found.attributes is None or not facts.attribute_columns:
        return replace(read, attributes=labels)
    try:
        flagged = read_attributes(read.found.attributes, facts.attribute_columns)
    except NatBenchError as error:
        return replace(read, attributes=labels, attribute_fault=str(error))
    return replace(read, attributes=labels | flagged)


def attribute_names(read: list[ReadSequence], facts: DatasetFacts | None) -> tuple[str, ...]:
    """The attributes that could be read, in published order."""
    if facts is None:
        return ()
    files = any(r.found.attributes is not None and not r.attribute_fault for r in read)
    return (*(facts.attribute_columns if files else ()), *facts.labels)
