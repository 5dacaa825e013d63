"""Writing the index of a dataset: what `nat-bench dataset index` does."""

import logging
import os
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from hashlib import sha256
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from nat2024.archives import read_bytes
from nat2024.datasets.annotations import read_side_file
from nat2024.datasets.converters.got10k import read_folder
from nat2024.datasets.converters.published import UNNAMED_FLAGS
from nat2024.datasets.described import frame_names
from nat2024.datasets.frames import count_frames
from nat2024.datasets.layouts import FoundSequence, find_layout
from nat2024.datasets.reading import (
    Place,
    ReadSequence,
    attribute_names,
    locate,
    read_sequence,
    read_sequences,
)
from nat2024.datasets.records import (
    annotated_rows,
    frame_files,
    inner_folder,
    replace_fields,
)
from nat2024.datasets.schema import (
    INDEX_FILE,
    AnnotatedDataset,
    AnnotatedSequence,
    FrameFiles,
    encode_dataset,
)
from nat2024.datasets.schema_checks import check_dataset
from nat2024.datasets.terms import attribute_term
from nat2024.datasets.video import VideoFrames
from nat2024.errors import (
    DatasetIncomplete,
    DatasetNotFound,
    FrameUnreadable,
    UsageError,
)
from nat2024.files import write_atomic

_THREADS = 4
_log = logging.getLogger("nat2024")


def index_dataset(
    name_or_path: str | os.PathLike[str],
    root: str | os.PathLike[str] | None = None,
    *,
    checksums: bool = True,
) -> AnnotatedDataset:
    """Describe a dataset in the annotation schema, sequences without boxes included.

    Frames, boxes and flags are read from the files of the dataset. Where it has an index already,
    its words (title, categories, attributes and so on) are kept, and so are boxes that stand
    nowhere else.

    Args:
        name_or_path: as in `load_dataset`.
        root: as in `load_dataset`.
        checksums: record size and sha256 of every frame.

    Raises:
        AnnotationInvalid: an index that is there cannot be used, or names cannot be written.
        DatasetNotFound, DatasetIncomplete, UsageError: as `load_dataset`.
    """
    place = locate(name_or_path, root)
    own = {n: r for n, r in plain_sequences(place).items() if r.fault is None and _has_rows(r)}
    read = sound(place, [_with_own_files(r, own) for r in read_sequences(place)])
    there = {r.name for r in read}
    read += [one for name, one in own.items() if name not in there]
    known = columns_known(place)
    records = [
        record_of(one, place.folder, checksums=checksums, columns_known=known) for one in read
    ]
    return document_of(place, read, records)


def _with_own_files(read: ReadSequence, own: dict[str, ReadSequence]) -> ReadSequence:
    """The sequence with frames and boxes of its own files, and the words of the index."""
    plain = own.get(read.name)
    if plain is None or read.found.record is None:
        return read
    record = replace_fields(read.found.record, annotated_rows(plain.boxes, plain.keyframes))
    if not np.array_equal(read.boxes, plain.boxes, equal_nan=True):
        record, read = _without_computed(record, read)
    found = replace(plain.found, record=record)
    return replace(read, found=found, boxes=plain.boxes, keyframes=plain.keyframes, fault=None)


def _without_computed(
    record: AnnotatedSequence, read: ReadSequence
) -> tuple[AnnotatedSequence, ReadSequence]:
    """Both without labels that were computed from boxes that are no longer there."""
    computed = {name for name, origin in read.provenance.items() if origin == "computed"}
    if computed:
        names = ", ".join(sorted(computed))
        _log.warning("%s: its boxes have changed, computed labels left out: %s", read.name, names)
    told = {n: p for n, p in record.attributes.items() if n not in computed}
    provenance = {n: p for n, p in read.provenance.items() if n not in computed}
    return (
        replace_fields(record, {"attributes": told}),
        replace(read, attributes=read.attributes - computed, provenance=provenance),
    )


def columns_known(place: Place) -> bool:
    """Whether the columns of the dataset's attribute files have names."""
    return bool(place.facts and place.facts.attribute_columns)


def sound(place: Place, read: list[ReadSequence]) -> list[ReadSequence]:
    """The sequences, if nothing is wrong with any of them.

    Raises:
        DatasetIncomplete: names the first fault and how many there are.
    """
    faults = [str(r.fault or r.attribute_fault) for r in read if r.fault or r.attribute_fault]
    if faults:
        more = f" (and {len(faults) - 1} more)" if len(faults) > 1 else ""
        msg = f"dataset {place.name}: {faults[0]}{more}"
        raise DatasetIncomplete(msg)
    return read


def plain_sequences(place: Place) -> dict[str, ReadSequence]:
    """What the folder of a described dataset holds by its layout alone, by name."""
    if place.layout.document is None:
        return {}
    try:
        layout = find_layout(place.folder)
    except (DatasetNotFound, DatasetIncomplete):
        return {}
    return {found.name: read_sequence(found, None, place.folder) for found in layout.sequences}


def _has_rows(read: ReadSequence) -> bool:
    return read.found.boxes is not None or read.found.keyframes is not None


def document_of(
    place: Place, read: list[ReadSequence], records: Iterable[AnnotatedSequence]
) -> AnnotatedDataset:
    """The whole annotation: what is published about the dataset, and its sequences."""
    document = place.layout.document
    if document is not None:
        changed = msgspec.structs.replace(document, sequences=tuple(records))
        return check_dataset(changed, str(place.folder))
    facts = place.facts
    names = (*attribute_names(read, place), *sorted({a for r in read for a in r.attributes}))
    changed = AnnotatedDataset(
        name=place.name,
        title=facts.title if facts else "",
        licence=facts.licence if facts else "",
        citation=facts.paper if facts else "",
        fps=(facts.frame_rate or None) if facts else None,
        resolution=facts.resolution if facts else None,
        attributes=tuple(attribute_term(name) for name in dict.fromkeys(names)),
        sequences=tuple(records),
    )
    return check_dataset(changed, str(place.folder))


def record_of(
    read: ReadSequence, base: Path, *, checksums: bool, columns_known: bool
) -> AnnotatedSequence:
    """The annotation of one sequence, with its frames where they lie now.

    Args:
        read: the sequence.
        base: folder of the dataset.
        checksums: record size and sha256 of every frame.
        columns_known: whether the columns of attribute files have names; else the files are kept
            as text.

    Raises:
        AnnotationInvalid: the frames lie outside of `base`.
        FrameUnreadable: a frame cannot be read, or none has a size.
    """
    frames = files_of(read.found, base)
    if checksums:
        frames = with_checksums(frames, read.found)
    if read.found.record is not None:
        return replace_fields(read.found.record, {"frames": frames})
    found: dict[str, Any] = {
        "name": read.name,
        "frames": frames,
        **annotated_rows(read.boxes, read.keyframes),
        "attributes": {a: read.provenance.get(a, "published") for a in sorted(read.attributes)},
        "resolution": _resolution(read.found),
    }
    if read.visible is not None:
        found["visible"] = tuple(read.visible.astype(int).tolist())
    found |= read_folder(read.found.folder, read.found.side_files, frames.count)
    found |= {"category": read.category, "activity": read.activity}
    if read.found.attributes is not None and not columns_known:
        flags = read_side_file(read.found.attributes).decode("utf-8", "replace")
        found["extra"] = {**found.get("extra", {}), UNNAMED_FLAGS: flags.strip()}
    return AnnotatedSequence(**found)


def _resolution(found: FoundSequence) -> tuple[int, int] | None:
    try:
        return found.frames.frame_size
    except FrameUnreadable:
        return None


def files_of(found: FoundSequence, base: Path) -> FrameFiles:
    """The files of a sequence as an index in the folder `base` names them."""
    is_video = isinstance(found.frames, VideoFrames)
    single = is_video and base == found.frames.folder / frame_names(found)[0]
    folder = inner_folder(found.frames.folder, base.parent if single else base)
    if isinstance(found.frames, VideoFrames):
        name = found.frames.path.name
        return FrameFiles(folder=folder, count=count_frames(found.frames), video=name)
    return frame_files(folder, found.frames.names)


def with_checksums(frames: FrameFiles, found: FoundSequence) -> FrameFiles:
    """The same files with sizes and checksums of what lies there now.

    Raises:
        FrameUnreadable: a file cannot be read.
    """
    rows = list(checksums_of([found.frames.folder / name for name in frame_names(found)]))
    sizes, sums = zip(*rows, strict=True)
    return msgspec.structs.replace(frames, sizes=sizes, sha256=sums)


def checksums_of(paths: Iterable[Path]) -> Iterator[tuple[int, str]]:
    """Bytes and sha256 of files, in their order."""
    with ThreadPoolExecutor(min(_THREADS, os.cpu_count() or 1)) as pool:
        yield from pool.map(_checksum, paths)


def _checksum(path: Path) -> tuple[int, str]:
    try:
        raw = read_bytes(path)
    except OSError as error:
        msg = f"{path}: cannot be read ({error.strerror})"
        raise FrameUnreadable(msg) from None
    return len(raw), sha256(raw).hexdigest()


def index_path(name_or_path: str | os.PathLike[str], root: str | os.PathLike[str] | None) -> Path:
    """Where the index of a dataset belongs: in its folder, or at the index that was named.

    Raises:
        UsageError: the dataset is no folder, so that nothing can be written into it.
    """
    path = Path(name_or_path)
    if path.name == INDEX_FILE:
        return path
    folder = locate(name_or_path, root).folder
    if not folder.is_dir():
        msg = f"{folder} is no folder that an index can be written to; name its place with --out"
        raise UsageError(msg)
    return folder / INDEX_FILE


def write_index(document: AnnotatedDataset, path: Path, *, force: bool = False) -> None:
    """Write an index file, whole or not at all.

    Raises:
        UsageError: there is one already, unless `force`.
        AnnotationInvalid: a name in it is no Unicode text.
    """
    if path.exists() and not force:
        msg = f"{path} is there already; --force writes it anew"
        raise UsageError(msg)
    write_atomic(path, encode_dataset(document))
