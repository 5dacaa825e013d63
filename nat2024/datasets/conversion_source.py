"""What `convert` reads: any dataset as one annotated document, with the places of its frames."""

import os
from dataclasses import dataclass, replace
from pathlib import Path

from nat2024.datasets.described import frame_names, layout_of, read_as
from nat2024.datasets.index import columns_known, document_of, record_of, sound, with_checksums
from nat2024.datasets.layouts import find_layout
from nat2024.datasets.reading import Place, ReadSequence, locate, read_sequences
from nat2024.datasets.recognition import recognise_layout
from nat2024.datasets.records import replace_fields
from nat2024.datasets.schema import AnnotatedDataset, AnnotatedSequence
from nat2024.errors import DatasetNotFound

_FOLDERS = ("published", "got10k")


@dataclass(frozen=True, slots=True)
class Source:
    """A dataset that is to be converted.

    Attributes:
        document: its annotation.
        frames: where the files of each sequence lie, in the order of its `frames.files()`.
        words: the format in words.
        remarks: what could not be kept, one line each.
    """

    document: AnnotatedDataset
    frames: dict[str, tuple[Path, ...]]
    words: str
    remarks: tuple[str, ...] = ()


def read_source(
    source: str | os.PathLike[str],
    root: str | os.PathLike[str] | None,
    source_format: str | None,
    *,
    with_frames: bool,
    checksums: bool,
) -> Source:
    """Read a dataset for conversion.

    Args:
        source: as `name_or_path` of `load_dataset`.
        root: as in `load_dataset`.
        source_format: name of its format, None finds it out.
        with_frames: the frames must be there.
        checksums: record size and sha256 of every frame where an index did not.

    Raises:
        UsageError: no such format.
        AnnotationInvalid: its annotation cannot be used.
        DatasetNotFound, DatasetIncomplete: as `load_dataset`, or not of that format.
    """
    place = locate(source, root) if source_format is None else _locate_as(source, source_format)
    read = read_sequences(place)
    if not with_frames:
        read = [_without_frames(one) for one in read]
    read = sound(place, read)
    records = [_record(one, place, checksums and with_frames) for one in read]
    frames = {
        r.name: tuple(r.found.frames.folder / name for name in frame_names(r.found)) for r in read
    }
    document = document_of(place, read, records)
    return Source(document, frames, place.layout.words, place.layout.remarks)


def _locate_as(source: str | os.PathLike[str], name: str) -> Place:
    path = Path(source).expanduser()
    described = read_as(path, name)
    if described is not None:
        layout, folder = layout_of(described), described.base
    elif name in _FOLDERS:
        layout, folder = find_layout(path), path
    else:
        msg = f"{path}: no dataset of the format {name} there"
        raise DatasetNotFound(msg)
    title = folder.resolve().name or "dataset"
    return Place(title, False, folder, layout, recognise_layout(layout))


def _without_frames(read: ReadSequence) -> ReadSequence:
    """The same sequence; that an annotation file names frames which are not there is no fault."""
    missing = read.found.record is not None and read.frames_fault
    return replace(read, fault=None) if missing else read


def _record(read: ReadSequence, place: Place, checksums: bool) -> AnnotatedSequence:
    record = read.found.record
    if record is None:
        known = columns_known(place)
        return record_of(read, place.folder, checksums=checksums, columns_known=known)
    if not checksums or record.frames.sha256:
        return record
    return replace_fields(record, {"frames": with_checksums(record.frames, read.found)})
