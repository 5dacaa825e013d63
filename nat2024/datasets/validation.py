"""Is a download whole and unaltered: what `nat-bench dataset validate` shows."""

import os
import re
from collections.abc import Iterator
from typing import Literal, TypeAlias

import msgspec
import numpy as np

from nat2024.datasets.box_notes import box_notes
from nat2024.datasets.frames import FolderFrames, StoredFrames, count_frames
from nat2024.datasets.index_checks import check_index, count_checksums
from nat2024.datasets.reading import Place, ReadSequence, locate, read_sequences
from nat2024.datasets.registered import DatasetFacts, SequenceFacts, registered_dataset
from nat2024.datasets.roots import bundled_archive
from nat2024.errors import FrameUnreadable

FindingKind: TypeAlias = Literal[
    "missing",
    "extra",
    "altered",
    "length",
    "first_box",
    "annotation",
    "frame",
    "size",
    "attributes",
]
_TOLERANCE_PX = 0.01
_NUMBER = re.compile(r"[0-9]+")


class Finding(msgspec.Struct, frozen=True):
    """One thing that is wrong.

    Attributes:
        kind: `missing`, `extra`, `altered`, `length`, `first_box`, `annotation`, `frame`, `size`
            or `attributes`.
        sequence: name of the sequence.
        message: one line that begins with that name and says what is there and what is expected.
    """

    kind: FindingKind
    sequence: str
    message: str


class ValidationReport(msgspec.Struct, frozen=True, kw_only=True):
    """What `validate` found.

    Attributes:
        name: registered name, or base name of the folder.
        checked_against: title of the dataset whose published facts were compared, or empty.
        layout: the folder layout in words.
        root: the folder.
        sequences: number of sequences in the folder.
        frames: number of images in the folder.
        ok: whether there are no problems.
        problems: what is missing, extra, altered or unreadable.
        notes: what is known and harmless.
        unchecked: what cannot be checked, because nothing public tells.
        index: the annotation file that the folder was compared with, in words, or empty.
    """

    name: str
    checked_against: str
    layout: str
    root: str
    sequences: int
    frames: int
    ok: bool
    problems: tuple[Finding, ...]
    notes: tuple[str, ...]
    unchecked: tuple[str, ...]
    index: str = ""


def validate(
    name_or_path: str | os.PathLike[str],
    root: str | os.PathLike[str] | None = None,
    *,
    against: str | DatasetFacts | None = None,
    every_frame: bool = False,
    look_at_frames: bool = True,
) -> ValidationReport:
    """Check a folder against itself and against what is published about the dataset in it.

    Compared with published facts: names, lengths, first boxes, image size. Checked in any
    folder: boxes and images agree in number, every box file can be read, first frames decode,
    all frames of a sequence have one size by their headers, no two images have one number, no
    file is a link out of the folder. Boxes outside the image, without a size or NaN are noted.
    Where the folder has an index: every file is there, none is extra, checksums and boxes agree.

    Args:
        name_or_path: a registered name or a folder.
        root: as in `load_dataset`.
        against: registered name or facts of the dataset that it is meant to be; None takes the
            registered name, else what names and lengths say it is.
        every_frame: decode all frames instead of the first of each sequence.
        look_at_frames: False compares names, lengths and boxes only, and opens no image.

    Raises:
        DatasetNotFound, DatasetIncomplete, UsageError: the dataset as a whole is not there or
            not what was asked for, as `load_dataset`.
    """
    place = locate(name_or_path, root)
    facts = registered_dataset(against) if isinstance(against, str) else against or place.facts
    read = read_sequences(place)
    problems = [*_check_names(place, facts)]
    for sequence in read:
        published = facts.sequences.get(sequence.name) if facts else None
        problems += _check_annotation(sequence, published)
        problems += _check_length(sequence, published)
        problems += _check_first_box(sequence, published)
        if look_at_frames and not sequence.frames_fault:
            problems += _check_frames(sequence.found.frames, sequence.name, facts, every_frame)
            problems += _check_sizes(sequence.found.frames, sequence.name, every_frame)
    problems += [Finding(*fault) for fault in check_index(place, read)]
    return ValidationReport(
        name=place.name,
        checked_against=facts.title if facts else "",
        layout=place.layout.words,
        root=str(place.folder),
        sequences=len(read),
        frames=sum(count_frames(r.found.frames) for r in read),
        ok=not problems,
        problems=tuple(problems),
        notes=(*_index_notes(place, read), *_notes(facts, read)),
        unchecked=tuple(_unchecked(place, facts, read)),
        index=place.layout.words if place.layout.document is not None else "",
    )


def _check_names(place: Place, facts: DatasetFacts | None) -> Iterator[Finding]:
    there = {s.name for s in place.layout.sequences}
    published = facts.sequences.keys() if facts else set()
    faulty = {*place.layout.empty, *place.layout.without_frames}
    for name in sorted(published - there - faulty):
        yield Finding("missing", name, f"{name}: missing")
    for name in place.layout.empty:
        yield Finding("missing", name, f"{name}: the folder holds no images")
    for name in place.layout.without_frames:
        yield Finding("missing", name, f"{name}: boxes but no folder of images")
    if facts and published and not facts.reported_only:
        for name in sorted(there - published):
            yield Finding("extra", name, f"{name}: not in the published list")


def _check_annotation(read: ReadSequence, published: SequenceFacts | None) -> Iterator[Finding]:
    if read.fault is not None:
        message = str(read.fault)
        message = message if message.startswith(read.name) else f"{read.name}: {message}"
        yield Finding("frame" if read.frames_fault else "annotation", read.name, message)
    elif published and not read.has_boxes:
        yield Finding("annotation", read.name, f"{read.name}: no box file")
    if read.attribute_fault:
        yield Finding("attributes", read.name, f"{read.name}: {read.attribute_fault}")


def _check_length(read: ReadSequence, published: SequenceFacts | None) -> Iterator[Finding]:
    count = count_frames(read.found.frames)
    if published and count not in (published.frames, *published.other_frames):
        message = f"{read.name}: {count} frames, published {published.frames}"
        yield Finding("length", read.name, message)


def _check_first_box(read: ReadSequence, published: SequenceFacts | None) -> Iterator[Finding]:
    if not published or published.first_box is None or not len(read.boxes):
        return
    if np.allclose(read.boxes[0], published.first_box, rtol=0, atol=_TOLERANCE_PX):
        return
    found, expected = _text(read.boxes[0].tolist()), _text(list(published.first_box))
    message = f"{read.name}: first box {found}, published {expected}"
    yield Finding("first_box", read.name, message)


def _check_frames(
    frames: StoredFrames, name: str, facts: DatasetFacts | None, every_frame: bool
) -> Iterator[Finding]:
    for index in range(len(frames) if every_frame else min(1, len(frames))):
        try:
            height, width = frames[index].shape[:2]
        except FrameUnreadable as error:
            yield Finding("frame", name, f"{name}: {error}")
            continue
        if facts and facts.resolution and (width, height) != facts.resolution:
            expected = "{}x{}".format(*facts.resolution)
            message = f"{name}: {frames.title(index)} is {width}x{height}, published {expected}"
            yield Finding("size", name, message)
            return


def _check_sizes(frames: StoredFrames, name: str, every_frame: bool) -> Iterator[Finding]:
    """Frames of another size than the first, and headers that cannot be read, in one line each."""
    if not isinstance(frames, FolderFrames):
        return
    sizes: list[tuple[int, int] | None] = []
    faults = []
    for index in range(len(frames)):
        try:
            sizes.append(frames.size_of(index))
        except FrameUnreadable as error:
            sizes.append(None)
            faults.append(str(error))
    first = next((size for size in sizes if size), None)
    other = [index for index, size in enumerate(sizes) if size not in (first, None)]
    if first and other:
        width, height = sizes[other[0]] or first
        message = (
            f"{name}: frames of several sizes: {frames.title(other[0])} is {width}x{height}, the "
            f"first frame {first[0]}x{first[1]}; {len(other)} of {len(frames)} differ from it"
        )
        yield Finding("size", name, message)
    later = faults if sizes[0] else faults[1:]  # the first frame has been decoded and named before
    if later and not every_frame:
        message = f"{name}: {len(later)} images cannot be read, such as {later[0]}"
        yield Finding("frame", name, message)


def _index_notes(place: Place, read: list[ReadSequence]) -> Iterator[str]:
    if place.layout.document is not None:
        checksums = count_checksums(read) or "no"
        yield f"compared with {place.layout.words}, which has {checksums} checksums"


def _notes(facts: DatasetFacts | None, read: list[ReadSequence]) -> Iterator[str]:
    if facts is None or not facts.sequences:
        without = [r.name for r in read if not r.has_boxes]
        if without:
            yield f"{len(without)} of {len(read)} sequences have no box for every frame"
    for sequence in read:
        yield from box_notes(sequence)
    if facts is None:
        return
    extra = [r.name for r in read if r.name not in facts.sequences]
    if facts.reported_only and extra:
        yield f"{len(extra)} sequences beyond the {len(facts.sequences)} reported, as expected"
    for sequence in read:
        published = facts.sequences.get(sequence.name)
        if published:
            yield from _sequence_notes(sequence, published, facts.frame_digits)


def _sequence_notes(read: ReadSequence, published: SequenceFacts, digits: int) -> Iterator[str]:
    frames = read.found.frames
    count = count_frames(frames)
    if count in published.other_frames:
        yield (
            f"{read.name}: {count} frames, as another public list says; "
            f"{published.frames} in the official results"
        )
    first = frames.names[0] if frames.names else ""
    numbers = _NUMBER.findall(first.rpartition(".")[0])
    if numbers and int(numbers[-1]) != published.first_frame:
        yield f"{read.name}: first image {first}, published number {published.first_frame}"
    elif numbers and digits and len(numbers[-1]) != digits:
        yield f"{read.name}: first image {first}, published names have {digits} digits"


def _unchecked(place: Place, facts: DatasetFacts | None, read: list[ReadSequence]) -> Iterator[str]:
    if facts is None:
        yield (
            "names, lengths and first boxes: not recognised as a registered dataset"
            f"{_nearest(place)}, so there is nothing published to compare with"
        )
        return
    if place.folder == bundled_archive(place.name):
        return  # it came with the package, and its archive has checksums of its own
    yield from facts.unchecked
    if any(r.has_boxes for r in read):
        yield "boxes after the first row: no ground truth is public"
    if any(r.found.attributes for r in read):
        note = f" ({facts.attribute_note})" if facts.attribute_note else ""
        yield f"attribute values: no public copy to compare with{note}"
    if not count_checksums(read):
        yield "pixels: no checksums of the images are published"


def _nearest(place: Place) -> str:
    if not place.recognition.candidates:
        return ""
    best = place.recognition.candidates[0]
    return f" (nearest: {best.name}, {best.shared} names shared, {best.equal} of the same length)"


def _text(box: list[float]) -> str:
    return ",".join(f"{value:g}" for value in box)
