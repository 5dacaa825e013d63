"""What is to be enhanced: an image, a folder of images, a video or a dataset."""

import logging
import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath
from typing import Literal, TypeAlias

from nat2024.archives import is_archive
from nat2024.datasets.described import is_annotation_file
from nat2024.datasets.frames import IMAGE_EXTENSIONS
from nat2024.datasets.layouts import FoundSequence, Layout
from nat2024.datasets.listings import Listing, path_kind
from nat2024.datasets.reading import Place, locate
from nat2024.datasets.registered import is_registered, list_datasets
from nat2024.datasets.video import VIDEO_EXTENSIONS, VideoFrames
from nat2024.enhancing.pictures import Picture, read_picture
from nat2024.errors import DatasetNotFound, UnknownSequence, UsageError
from nat2024.files import expand
from nat2024.types import closest

Kind: TypeAlias = Literal["image", "images", "video", "dataset"]
"""How an input is read."""

_log = logging.getLogger("nat2024")


@dataclass(frozen=True, slots=True)
class ImageItem:
    """One image file; what is made of it gets the same name.

    Attributes:
        source: the file, perhaps inside a .zip archive.
        target: where the enhanced image goes, from the folder of the enhancer.
        sequence: name of the sequence it belongs to, empty outside of datasets.
    """

    source: Path
    target: PurePosixPath
    sequence: str = ""

    def __len__(self) -> int:
        """One image."""
        return 1

    def title(self, index: int = 0) -> str:  # noqa: ARG002 - as of a video
        """What to call it in a line for people."""
        return str(self.target)

    def read(self, index: int = 0) -> Picture:  # noqa: ARG002 - as of a video
        """The image; `FrameUnreadable` where it is none."""
        return read_picture(self.source)


@dataclass(frozen=True, slots=True)
class VideoItem:
    """One video.

    Attributes:
        frames: of the video.
        target: its own name, from the folder of the enhancer; the ending may become another.
        sequence: as in `ImageItem`.
        every: take every so many-th frame.
        limit: at most so many of them, None for all.
    """

    frames: VideoFrames
    target: PurePosixPath
    sequence: str = ""
    every: int = 1
    limit: int | None = None

    @property
    def numbers(self) -> range:
        """Numbers of the frames that are taken; `FrameUnreadable` where there is no video."""
        return range(0, len(self.frames), self.every)[: self.limit]

    def __len__(self) -> int:
        """Number of frames that are taken."""
        return len(self.numbers)

    @property
    def rate(self) -> float:
        """Frames a second of those that are taken, 25 where times do not tell."""
        times = self.frames.index.times
        span = times[-1] - times[0]
        return 1000 * (len(times) - 1) / span / self.every if span > 0 else 25.0

    def title(self, index: int) -> str:
        """What to call frame `index` of those taken in a line for people."""
        return f"{self.target} frame {self.numbers[index]}"

    def read(self, index: int) -> Picture:
        """Frame `index` of those taken; `FrameUnreadable` where it cannot be decoded."""
        return Picture(self.frames[self.numbers[index]])


Item: TypeAlias = ImageItem | VideoItem


@dataclass(frozen=True, slots=True)
class Source:
    """An input that was found.

    Attributes:
        path: the file or folder.
        kind: how it is read.
        items: image files, and videos.
        place: where the dataset lies, None where it is none.
        selected: whether only some sequences of the dataset were asked for.
    """

    path: Path
    kind: Kind
    items: tuple[Item, ...]
    place: Place | None = None
    selected: bool = False

    @property
    def layout(self) -> Layout | None:
        """Layout of the dataset, None where it is none."""
        return self.place.layout if self.place else None


def find_source(
    name_or_path: str | os.PathLike[str],
    root: str | os.PathLike[str] | None = None,
    *,
    as_images: bool = False,
    sequences: Iterable[str] | None = None,
    every: int = 1,
    limit: int | None = None,
) -> Source:
    """Find out what an input is.

    A folder counts as a dataset where boxes lie with its frames; any other folder is one of images.

    Args:
        name_or_path: an image, a video, a folder or .zip archive, or the name of a registered
            dataset.
        root: folder of a registered dataset, as in `load_dataset`.
        as_images: read a folder as images even where it is a dataset, without its boxes.
        sequences: of a dataset, only these.
        every: take every so many-th image of a folder, or frame of a video.
        limit: at most so many images, or frames of a video.

    Raises:
        DatasetNotFound: nothing is there, or no image is in it.
        DatasetIncomplete, AnnotationInvalid: as `load_dataset`.
        UnknownSequence: the dataset has no such sequence.
        UsageError: options that do not fit this input.
    """
    if every < 1 or (limit is not None and limit < 1):
        msg = f"every and limit must be at least 1, not {every} and {limit}"
        raise UsageError(msg)
    path = expand(name_or_path)
    place = None if as_images else _dataset(name_or_path, path, root)
    if place is not None:
        if every > 1 or limit is not None:
            msg = (
                f"{name_or_path} is a dataset, which stays whole: --every and --limit would part "
                "frames from boxes; name --sequences, or read it with --images"
            )
            raise UsageError(msg)
        return _of_dataset(place, sequences)
    if sequences is not None:
        msg = f"sequences are those of a dataset, but {name_or_path} is read as images"
        raise UsageError(msg)
    if path_kind(path) == "file" and not is_archive(path):
        return _of_file(path, every, limit)
    return _of_folder(path, every, limit)


def _dataset(
    given: str | os.PathLike[str], path: Path, root: str | os.PathLike[str] | None
) -> Place | None:
    """Where the dataset lies; None where the input is another thing."""
    registered = isinstance(given, str) and is_registered(given)
    if not registered and path_kind(path) == "absent":
        name = str(given).lower().replace("-", "_")
        near = "" if {"/", ".", os.sep} & set(name) else closest(name, list_datasets())
        msg = f"{given}: no such image, video, folder or registered dataset{near}"
        raise DatasetNotFound(msg)
    is_one_file = path_kind(path) == "file" and not (is_archive(path) or is_annotation_file(path))
    if not registered and is_one_file:
        return None
    try:
        place = locate(given, root)
    except DatasetNotFound:
        if registered:
            raise
        return None
    return place if registered or any(map(_is_annotated, place.layout.sequences)) else None


def _is_annotated(found: FoundSequence) -> bool:
    return bool(found.boxes or found.keyframes or found.record)


def _of_file(path: Path, every: int, limit: int | None) -> Source:
    suffix = path.suffix.lower()
    target = PurePosixPath(path.name)
    if suffix in VIDEO_EXTENSIONS:
        video = VideoItem(VideoFrames(path), target, every=every, limit=limit)
        return Source(path, "video", (video,))
    if suffix in IMAGE_EXTENSIONS:
        return Source(path, "image", (ImageItem(path, target),))
    known = ", ".join(sorted(IMAGE_EXTENSIONS | VIDEO_EXTENSIONS))
    msg = f"{path}: neither an image nor a video ({known}), nor a folder of images"
    raise UsageError(msg)


def _of_folder(path: Path, every: int, limit: int | None) -> Source:
    videos: list[str] = []
    found = [ImageItem(source, target) for source, target in _walk(path, videos)]
    if videos:
        more = f" and {len(videos) - 3} more" if len(videos) > 3 else ""
        _log.warning(
            "%s: videos left out, name each by itself: %s%s", path, ", ".join(videos[:3]), more
        )
    if not found:
        msg = f"{path}: no images in it ({', '.join(sorted(IMAGE_EXTENSIONS))})"
        raise DatasetNotFound(msg)
    return Source(path, "images", tuple(found[::every][:limit]))


def _walk(top: Path, videos: list[str]) -> Iterator[tuple[Path, PurePosixPath]]:
    """Images below a folder in order, hidden ones left out; a folder is entered once."""
    seen: set[Path] = set()

    def walk(listing: Listing, inner: PurePosixPath) -> Iterator[tuple[Path, PurePosixPath]]:
        actual = listing.path.resolve()
        if actual in seen:  # a link that leads back
            return
        seen.add(actual)
        for name in listing.images:
            yield listing.path / name, inner / name
        videos.extend(str(inner / name) for name in listing.videos)
        for name in listing.folders:
            yield from walk(listing.child(name), inner / name)

    yield from walk(Listing.of(top), PurePosixPath())


def _of_dataset(place: Place, sequences: Iterable[str] | None) -> Source:
    known = {found.name: found for found in place.layout.sequences}
    if sequences is not None:
        wanted = set(sequences)
        for name in sorted(wanted - known.keys()):
            msg = f"dataset {place.name} has no sequence {name!r}{closest(name, known)}"
            raise UnknownSequence(msg)
        kept = tuple(found for found in place.layout.sequences if found.name in wanted)
        place = replace(place, layout=replace(place.layout, sequences=kept))
    items = tuple(item for found in place.layout.sequences for item in _items(found, place.folder))
    if not items:
        msg = f"{place.folder}: dataset {place.name} has no frame"
        raise DatasetNotFound(msg)
    return Source(place.folder, "dataset", items, place, sequences is not None)


def _items(found: FoundSequence, base: Path) -> Iterator[Item]:
    folder = PurePosixPath(found.frames.folder.relative_to(base).as_posix())
    if isinstance(found.frames, VideoFrames):
        yield VideoItem(found.frames, folder / found.frames.path.name, found.name)
        return
    for name in found.frames.names:
        yield ImageItem(found.frames.folder / name, folder / name, found.name)
