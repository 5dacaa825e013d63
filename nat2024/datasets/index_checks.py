"""A folder compared with the annotation file that describes it, as `validate` does."""

from collections.abc import Iterator
from pathlib import Path
from typing import Literal, TypeAlias

import numpy as np

from nat2024.datasets.described import frame_names
from nat2024.datasets.frames import FolderFrames
from nat2024.datasets.index import checksums_of, plain_sequences
from nat2024.datasets.listings import Listing, path_kind
from nat2024.datasets.reading import Place, ReadSequence
from nat2024.datasets.schema import AnnotatedSequence
from nat2024.types import Boxes

Fault: TypeAlias = tuple[Literal["altered", "extra", "annotation"], str, str]
"""Kind, name of the sequence, one line that begins with the name."""

_NAMED = 3


def check_index(place: Place, read: list[ReadSequence]) -> Iterator[Fault]:
    """What differs between a folder and its annotation file, but for missing frames.

    Frames are compared by size and checksum where the file has them, boxes with the box files of
    the folder, exactly. Frames that are missing are faults of `read` already.
    """
    if place.layout.document is None:
        return
    plain = plain_sequences(place)
    named: dict[Path, set[str]] = {}
    for one in read:
        named.setdefault(one.found.frames.folder, set()).update(frame_names(one.found))
    folders: set[Path] = set()
    for one in read:
        if one.found.record is None:
            continue
        yield from _altered(one, one.found.record)
        folder = one.found.frames.folder
        if folder not in folders:
            folders.add(folder)
            yield from _extra_frames(one, named[folder])
        own = plain.get(one.name)
        if own is not None and not own.frames_fault:
            yield from _other_boxes(one, own)
    known = {r.name for r in read}
    for name, own in sorted(plain.items()):
        if name not in known and own.found.frames.folder not in folders:
            yield "extra", name, f"{name}: not in {place.layout.words}"


def count_checksums(read: list[ReadSequence]) -> int:
    """Number of files whose checksums are known."""
    return sum(len(r.found.record.frames.sha256) for r in read if r.found.record is not None)


def _altered(read: ReadSequence, record: AnnotatedSequence) -> Iterator[Fault]:
    folder, names = read.found.frames.folder, frame_names(read.found)
    sums, sizes = record.frames.sha256, record.frames.sizes
    if len(names) not in (len(sums), len(sizes)):
        return
    there = [i for i, name in enumerate(names) if path_kind(folder / name) == "file"]
    found = checksums_of([folder / names[i] for i in there])
    changed = [
        names[i]
        for i, (size, checksum) in zip(there, found, strict=True)
        if (sizes and sizes[i] != size) or (sums and sums[i] != checksum)
    ]
    if changed:
        yield "altered", read.name, f"{read.name}: {_some(changed)} altered, by size or checksum"


def _extra_frames(read: ReadSequence, named: set[str]) -> Iterator[Fault]:
    folder = read.found.frames.folder
    if not isinstance(read.found.frames, FolderFrames) or path_kind(folder) != "folder":
        return
    extra = [name for name in Listing.of(folder).images if name not in named]
    if extra:
        yield "extra", read.name, f"{read.name}: {_some(extra)} not named by the index"


def _other_boxes(read: ReadSequence, own: ReadSequence) -> Iterator[Fault]:
    source = own.found.boxes or own.found.keyframes
    if source is None:
        return
    if own.fault is not None and not own.lengths_differ:
        yield "annotation", read.name, f"{read.name}: {own.fault}"
        return
    if len(own.boxes) != len(read.boxes):
        message = f"{len(own.boxes)} boxes in {source}, {len(read.boxes)} in the index"
        yield "annotation", read.name, f"{read.name}: {message}"
        return
    other = np.flatnonzero(~_equal_rows(own.boxes, read.boxes))
    if len(other):
        first = int(other[0])
        rows = (_text(own.boxes[first]), _text(read.boxes[first]))
        message = (
            f"{len(other)} boxes in {source} are not those of the index, such as frame {first} "
            f"(counted from 0): {rows[0]}, in the index {rows[1]}"
        )
        yield "annotation", read.name, f"{read.name}: {message}"


def _equal_rows(a: Boxes, b: Boxes) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    equal = (a == b) | (np.isnan(a) & np.isnan(b))
    return np.asarray(equal.all(axis=1), dtype=np.bool_)


def _text(row: Boxes) -> str:
    return ",".join(map(repr, row.tolist()))


def _some(names: list[str]) -> str:
    more = f" and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
    return ", ".join(names[:_NAMED]) + more
