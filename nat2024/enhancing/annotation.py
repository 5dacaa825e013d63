"""What makes enhanced frames a dataset again: the files beside the frames, and the index."""

from collections.abc import Collection, Iterable, Iterator
from pathlib import Path, PurePosixPath

import msgspec

from nat2024.archives import is_stored, read_bytes
from nat2024.datasets.converters.common import EXTRA_FILE
from nat2024.datasets.index import plain_sequences
from nat2024.datasets.layouts import FoundSequence
from nat2024.datasets.reading import Place
from nat2024.datasets.records import frame_files
from nat2024.datasets.schema import INDEX_FILE, FrameFiles, encode_dataset
from nat2024.datasets.video import VIDEO_EXTENSIONS, VideoFrames
from nat2024.datasets.video_writing import VIDEO_ENDING
from nat2024.errors import FrameUnreadable
from nat2024.files import write_atomic

_LISTS = frozenset({".txt", ".json", ".csv", ".ini", ".md"})
"""Endings of files directly in a dataset's folder that come along, such as GOT-10k's `list.txt`."""


def write_annotation(
    place: Place, folder: Path, whole: Collection[str], *, selected: bool = False
) -> None:
    """Write boxes, flags and attributes of a dataset beside its enhanced frames.

    Files are copied as they are, under their own names. An index, where there was one, is written
    anew for the frames that lie there now, without the checksums of the old ones.

    Args:
        place: where the dataset lies, with the sequences that were asked for.
        folder: of the enhanced frames.
        whole: names of the sequences of which every frame is there; the others get none.
        selected: whether only some sequences of the dataset were asked for; files that speak of
            all of them then stay behind.

    Raises:
        FrameUnreadable: a file of the dataset cannot be read.
        Unwritable: the file system refuses.
    """
    plain = [read.found for read in plain_sequences(place).values()]
    found = [*place.layout.sequences, *plain]
    files = {path for one in found if one.name in whole for path in _files(one)}
    if not selected and len(whole) == len(place.layout.sequences):
        files.update(_lists(place))
    for path in sorted(files):
        write_atomic(folder / _inner(path, place.folder), _read(path))
    if place.layout.document is not None:
        _write_index(place, folder, whole)


def _files(found: FoundSequence) -> Iterator[Path]:
    yield from (path for path in (found.boxes, found.keyframes, found.attributes) if path)
    for name in found.side_files:
        if Path(name).suffix.lower() not in VIDEO_EXTENSIONS:
            yield found.folder / name


def _lists(place: Place) -> Iterable[Path]:
    folder = place.layout.folder
    if not folder.is_dir():
        return ()
    described = (INDEX_FILE, EXTRA_FILE)  # the index says it all, for the frames that lie there now
    return (
        path
        for path in folder.iterdir()
        if path.suffix.lower() in _LISTS
        and path.name not in described
        and not path.name.startswith(".")
        and is_stored(path)
    )


def _read(path: Path) -> bytes:
    try:
        return read_bytes(path)
    except OSError as error:
        msg = f"{path}: cannot be read ({error.strerror or error})"
        raise FrameUnreadable(msg) from None


def _inner(path: Path, base: Path) -> PurePosixPath:
    return PurePosixPath(path.relative_to(base).as_posix())


def _write_index(place: Place, folder: Path, whole: Collection[str]) -> None:
    document = place.layout.document
    assert document is not None
    found = {one.name: one for one in place.layout.sequences}
    records = tuple(
        msgspec.structs.replace(
            record, frames=_frames(record.frames.count, found[record.name], place.folder, folder)
        )
        for record in document.sequences
        if record.name in whole
    )
    changed = msgspec.structs.replace(document, sequences=records)
    write_atomic(folder / INDEX_FILE, encode_dataset(changed))


def _frames(count: int, found: FoundSequence, base: Path, folder: Path) -> FrameFiles:
    """Files of the enhanced frames; a video may have become another, or frames."""
    inner = _inner(found.frames.folder, base)
    place = str(inner) if inner.parts else ""
    if not isinstance(found.frames, VideoFrames):
        return frame_files(place, found.frames.names)
    stem = found.frames.path.stem
    video = f"{stem}{VIDEO_ENDING}"
    if (folder / inner / video).is_file():
        return FrameFiles(folder=place, count=count, video=video)
    names = tuple(sorted(path.name for path in (folder / inner / stem).glob("*.png")))
    return frame_files(str(inner / stem), names)
