"""Datasets that an annotation file describes: an index, a side file, or JSON of another program."""

from collections.abc import Iterator
from pathlib import Path

from nat2024.archives import is_archive
from nat2024.datasets.converters import CONVERTERS, Converter, Described, coco_video, pysot
from nat2024.datasets.converters.common import EXTRA_FILE
from nat2024.datasets.converters.index import FORMAT as INDEX
from nat2024.datasets.layouts import FoundSequence, Layout
from nat2024.datasets.listings import Listing, path_kind
from nat2024.datasets.schema import INDEX_FILE, AnnotatedSequence, read_bytes
from nat2024.datasets.video import VideoFrames
from nat2024.errors import AnnotationInvalid, DatasetIncomplete, DatasetNotFound, UsageError
from nat2024.types import closest

_ANNOTATIONS = "annotations"
_SUFFIX = ".json"
_FOREIGN = ((pysot, pysot.recognise), (coco_video, coco_video.recognise))


def get_converter(name: str) -> Converter:
    """The converter of a format.

    Raises:
        UsageError: there is none; names the closest.
    """
    if name not in CONVERTERS:
        msg = f"no format {name!r}{closest(name, CONVERTERS)}; there are {', '.join(CONVERTERS)}"
        raise UsageError(msg)
    return CONVERTERS[name]


def is_annotation_file(path: Path) -> bool:
    """Whether a path is that of a JSON file."""
    return path.suffix.lower() == _SUFFIX and path_kind(path) == "file"


def find_described(folder: Path) -> Described | None:
    """What an index, or the side file of a format, says of a folder; None where there is none.

    Raises:
        AnnotationInvalid: there is one, but it cannot be used.
    """
    if path_kind(folder) != "folder" and not is_archive(folder):
        return None
    for converter in CONVERTERS.values():
        path = converter.find(folder)
        if path is not None:
            return converter.read(path, folder)
    return None


def find_foreign(folder: Path, only: str | None = None) -> Described | None:
    """What JSON of another program in a folder says, if exactly one such file is there.

    Args:
        folder: of the dataset; the file may lie in `annotations/` too.
        only: name of a format; None takes any.
    """
    if path_kind(folder) != "folder":
        return None
    found = [(path, _recognise(path)) for path in _candidates(folder)]
    fitting = [(p, c) for p, c in found if c is not None and only in (None, c.FORMAT)]
    if len(fitting) != 1:
        return None
    path, converter = fitting[0]
    return converter.read(path, folder)


def _candidates(folder: Path) -> Iterator[Path]:
    for place in (folder, folder / _ANNOTATIONS):
        if place.is_dir():
            yield from (path for path in sorted(place.glob(f"*{_SUFFIX}")) if path.is_file())


def _recognise(path: Path) -> Converter | None:
    """The converter of JSON that another program may have written."""
    if path.name in (INDEX_FILE, EXTRA_FILE):
        return None
    raw = read_bytes(path)
    return next((converter for converter, fits in _FOREIGN if fits(raw)), None)


def read_described(path: Path, base: Path | None = None) -> Described:
    """Read an index file, or JSON of another program, that was named itself.

    Args:
        path: the file.
        base: folder from which the frames are named; None takes that of the file, or the one
            above where that is called `annotations`.

    Raises:
        AnnotationInvalid: it is of no format that is known, or cannot be used.
    """
    base = base or _base_of(path)
    if path.name == EXTRA_FILE:
        described = find_described(base)
        if described is not None:
            return described
    converter = _recognise(path) or CONVERTERS[INDEX]
    return converter.read(path, base)


def read_as(path: Path, name: str) -> Described | None:
    """Read what an annotation file of the format `name` says; None where there is none.

    Args:
        path: a folder, or the file itself.
        name: of the format.

    Raises:
        UsageError: no such format.
        AnnotationInvalid: the file cannot be used.
    """
    converter = get_converter(name)
    if is_annotation_file(path):
        return converter.read(path, _base_of(path))
    own = converter.find(path)
    return converter.read(own, path) if own is not None else find_foreign(path, only=name)


def _base_of(path: Path) -> Path:
    return path.parent.parent if path.parent.name == _ANNOTATIONS else path.parent


def layout_of(described: Described) -> Layout:
    """The layout in which the annotation file says that the dataset lies."""
    sequences = tuple(_found(described, s) for s in described.document.sequences)
    return Layout(
        "described",
        described.base,
        described.words,
        sequences,
        document=described.document,
        remarks=described.remarks,
    )


def _found(described: Described, record: AnnotatedSequence) -> FoundSequence:
    frames = described.frames[record.name]
    return FoundSequence(record.name, frames.folder, frames, record=record)


def check_described(found: FoundSequence, base: Path) -> None:
    """Refuse frames that are not there, or that lie outside of the dataset's folder.

    Raises:
        DatasetIncomplete: names the first file and how many there are.
        AnnotationInvalid: a folder or file is a link that leads out.
    """
    folder = found.frames.folder
    if not folder.resolve().is_relative_to(base.resolve()):
        msg = f"{found.name}: {folder} leads out of {base}; put the frames themselves there"
        raise AnnotationInvalid(msg)
    listing = _listing(folder)
    names = {*listing.images, *listing.files} if listing else set()
    wanted = frame_names(found)
    missing = [name for name in wanted if name not in names]
    if missing:
        msg = f"{found.name}: {len(missing)} of {len(wanted)} frames are not in {folder}, "
        msg += f"such as {missing[0]}"
        raise DatasetIncomplete(msg)
    for name in listing.links.intersection(wanted) if listing else ():
        if not (folder / name).resolve().is_relative_to(base.resolve()):
            msg = (
                f"{found.name}: {folder / name} is a link out of {base}; put the file itself there"
            )
            raise AnnotationInvalid(msg)


def _listing(folder: Path) -> Listing | None:
    try:
        return Listing.of(folder)
    except DatasetNotFound:
        return None


def frame_names(found: FoundSequence) -> tuple[str, ...]:
    """Names of the files that hold the frames of a sequence."""
    if isinstance(found.frames, VideoFrames):
        return (found.frames.path.name,)
    return found.frames.names


def _listed(folder: Path) -> tuple[set[str], set[str]]:
    """Names of the files in a folder, and of those that are links; empty where there is none."""
    if not folder.is_dir():
        return set(), set()
    entries = list(folder.iterdir())
    return {e.name for e in entries}, {e.name for e in entries if e.is_symlink()}
