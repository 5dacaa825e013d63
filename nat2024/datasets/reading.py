"""From a name or path to sequences with their annotation; every fault kept beside its sequence.

`load_dataset` raises on these faults, `describe` and `validate` report them.
"""

import os
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from nat2024.archives import is_archive
from nat2024.boxes import parse_boxes
from nat2024.datasets.annotations import (
    read_attributes,
    read_keyframes,
    read_side_file,
    read_visible,
)
from nat2024.datasets.categories import activity_of, category_of
from nat2024.datasets.converters.got10k import read_meta
from nat2024.datasets.described import (
    check_described,
    find_described,
    find_foreign,
    is_annotation_file,
    layout_of,
    read_described,
)
from nat2024.datasets.file_checks import base_folder, check_files
from nat2024.datasets.frameless import AbsentFrames, find_annotation, with_frameless
from nat2024.datasets.layouts import FoundSequence, Layout, find_layouts, only_layout
from nat2024.datasets.listings import path_kind
from nat2024.datasets.recognition import Recognition, recognise_layout
from nat2024.datasets.records import all_boxes, flags_of, keyframes_of
from nat2024.datasets.registered import (
    DatasetFacts,
    is_registered,
    list_datasets,
    registered_dataset,
)
from nat2024.datasets.roots import find_root, how_to_get
from nat2024.datasets.schema import INDEX_FILE, AnnotatedSequence
from nat2024.errors import (
    AnnotationInvalid,
    DatasetIncomplete,
    DatasetNotFound,
    FrameUnreadable,
    NatBenchError,
    UsageError,
)
from nat2024.files import expand
from nat2024.types import Boxes, Flags, Sequence, closest


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
        frames_fault: whether that lies with the frames, not with the annotation.
        attribute_fault: why its attribute file cannot be used, empty where it can.
        category: as in `Sequence`.
        activity: as in `Sequence`.
        provenance: as in `Sequence`.
    """

    found: FoundSequence
    boxes: Boxes
    keyframes: npt.NDArray[np.intp] | None = None
    visible: Flags | None = None
    attributes: frozenset[str] = frozenset()
    fault: NatBenchError | None = None
    frames_fault: bool = False
    attribute_fault: str = ""
    category: str = ""
    activity: str = ""
    provenance: Mapping[str, str] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """Name of the sequence."""
        return self.found.name

    @property
    def has_boxes(self) -> bool:
        """Whether a file gives a box for every frame, however well."""
        record = self.found.record
        if record is not None:
            return record.boxes is not None and record.keyframes is None
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
        return Sequence(
            self.name,
            frames,
            boxes,
            visible,
            self.attributes,
            self.keyframes,
            self.category,
            self.activity,
            self.provenance,
        )


def locate(
    name_or_path: str | os.PathLike[str],
    root: str | os.PathLike[str] | None,
    *,
    frameless: bool = False,
) -> Place:
    """Find a dataset by registered name or path and recognise it.

    Nothing is read yet, but for an annotation file that describes the whole dataset. Such a file
    can also be named itself; `root` is then the folder of its frames. With `frameless` sequences
    without frames are found too.

    Raises:
        AnnotationInvalid: an annotation file cannot be used.
        DatasetNotFound: no such name and no such folder, or the folder is no dataset.
        DatasetIncomplete: the folder holds several datasets, or another one than was asked for.
        UsageError: a root was given for a path, or the configuration file is wrong.
    """
    if isinstance(name_or_path, str) and is_registered(name_or_path):
        return _locate_registered(name_or_path, root, frameless=frameless)
    folder = expand(name_or_path)
    if is_annotation_file(folder):
        return _locate_annotation(folder, root)
    if root is not None:
        msg = f"root={root} belongs to a registered dataset, but {name_or_path} is a folder"
        raise UsageError(msg)
    if path_kind(folder) == "absent":
        raise DatasetNotFound(_unknown(str(name_or_path)))
    layout = only_layout(folder, _layouts(folder, frameless=frameless))
    name = _base_name(folder)
    return Place(name, False, folder, layout, recognise_layout(layout))


def _locate_annotation(path: Path, root: str | os.PathLike[str] | None) -> Place:
    described = read_described(path, None if root is None else expand(root))
    layout = layout_of(described)
    name = _base_name(described.base) if path.name == INDEX_FILE else path.stem
    return Place(name, False, described.base, layout, recognise_layout(layout))


def _layouts(folder: Path, *, frameless: bool) -> tuple[Layout, ...]:
    """Layouts in a folder, perhaps with sequences of which the frames are absent."""
    if not frameless:
        return _layouts_with_frames(folder)
    try:
        found = tuple(map(with_frameless, _layouts_with_frames(folder)))
    except DatasetNotFound:
        if path_kind(folder) != "folder" and not is_archive(folder):
            raise
        annotation = find_annotation(folder)
        if annotation is None:
            raise
        return (annotation,)
    if _have_boxes(found):
        return found
    annotation = find_annotation(folder)  # the images are perhaps no dataset
    return (annotation,) if annotation is not None else found


def _have_boxes(layouts: tuple[Layout, ...]) -> bool:
    return any(s.boxes or s.keyframes or s.record for x in layouts for s in x.sequences)


def _layouts_with_frames(folder: Path) -> tuple[Layout, ...]:
    """Layouts in a folder: our annotation files go first, those of others before no boxes."""
    described = find_described(folder)
    if described is not None:
        return (layout_of(described),)
    try:
        layouts = find_layouts(folder)
    except DatasetNotFound:
        layouts = ()
    if _have_boxes(layouts):
        return layouts
    foreign = find_foreign(folder)
    if foreign is not None:
        return (layout_of(foreign),)
    return layouts or find_layouts(folder)


def _base_name(folder: Path) -> str:
    """Name of the folder, or of an archive or video without its ending."""
    whole = folder.resolve()
    name = whole.stem if path_kind(whole) == "file" else whole.name
    return name or "dataset"


def _locate_registered(name: str, root: str | os.PathLike[str] | None, *, frameless: bool) -> Place:
    folder = find_root(name, root)
    try:
        layouts = _layouts(folder, frameless=frameless)
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
    if os.sep in name or "/" in name:
        return f"{name}: no such folder"
    near = closest(name.lower().replace("-", "_"), list_datasets())
    return f"{name!r} is neither a registered dataset nor a folder{near}"


def read_sequences(place: Place, *, frameless: bool = False) -> list[ReadSequence]:
    """Read the annotation of every sequence; faults are kept, never raised."""
    root = base_folder(place.folder)
    return [
        read_sequence(found, place.facts, root, frameless=frameless)
        for found in place.layout.sequences
    ]


def read_sequence(
    found: FoundSequence,
    facts: DatasetFacts | None,
    root: Path | None = None,
    *,
    frameless: bool = False,
) -> ReadSequence:
    """Read the annotation of one sequence; a fault is kept, never raised.

    Args:
        found: where it lies.
        facts: what is published about the dataset.
        root: folder that linked files must not lead out of; None takes the sequence's own.
        frameless: take it without frames where an annotation file names some that are absent.
    """
    read = ReadSequence(found, np.empty((0, 4)))
    if found.record is not None:
        return _read_record(read, found.record, root or found.folder, frameless=frameless)
    read = _with_words(read)
    try:
        check_files(found, root or found.folder)
    except NatBenchError as error:
        return replace(read, fault=error, frames_fault=True)
    try:
        read = _read(found, read)
    except NatBenchError as error:
        return replace(read, fault=error, frames_fault=isinstance(error, FrameUnreadable))
    return _with_attributes(read, facts)


def _read_record(
    read: ReadSequence, record: AnnotatedSequence, root: Path, *, frameless: bool
) -> ReadSequence:
    read = replace(
        read,
        boxes=all_boxes(record),
        keyframes=keyframes_of(record),
        visible=flags_of(record.visible),
        attributes=frozenset(record.attributes),
        category=record.category or category_of(record.name),
        activity=record.activity or activity_of(record.name),
        provenance=record.attributes,
    )
    try:
        check_described(read.found, root)
    except DatasetIncomplete as error:
        if not frameless:
            return replace(read, fault=error, frames_fault=True)
        frames = AbsentFrames(read.found.frames.folder, read.name, record.frames.count)
        return replace(read, found=replace(read.found, frames=frames))
    except NatBenchError as error:
        return replace(read, fault=error, frames_fault=True)
    return read


def _with_words(read: ReadSequence) -> ReadSequence:
    """What the target is and does, by GOT-10k's file or by the sequence's name."""
    try:
        meta = read_meta(read.found.folder, read.found.side_files)
    except AnnotationInvalid:  # no reason to refuse boxes and frames
        meta = {}
    category = meta.get("category") or category_of(read.name)
    activity = meta.get("activity") or activity_of(read.name)
    return replace(read, category=category, activity=activity)


def _read(found: FoundSequence, read: ReadSequence) -> ReadSequence:
    images = len(found.frames)
    visible = read_visible(found.folder, found.side_files, images)
    read = replace(read, visible=visible)
    if found.boxes is not None:
        boxes = parse_boxes(read_side_file(found.boxes), str(found.boxes))
        fault = None
        if len(boxes) != images:
            there = "images" if found.frames.names else "frames that can be decoded"
            msg = f"{found.name}: {len(boxes)} boxes in {found.boxes} but {images} {there}"
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


def attribute_names(read: list[ReadSequence], place: Place) -> tuple[str, ...]:
    """The attributes that could be read, in published order."""
    if place.layout.document is not None:
        return place.layout.document.attribute_names
    facts = place.facts
    if facts is None:
        return ()
    files = any(r.found.attributes is not None and not r.attribute_fault for r in read)
    return (*(facts.attribute_columns if files else ()), *facts.labels)
