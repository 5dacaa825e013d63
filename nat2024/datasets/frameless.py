"""Sequences of which the annotation alone is there: enough to score results, which are boxes."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NoReturn

from nat2024.datasets.annotations import read_box_file
from nat2024.datasets.layouts import (
    ATTRIBUTE_FOLDERS,
    FRAME_FOLDERS,
    FoundSequence,
    Layout,
    SideFiles,
    make_layout,
    own_boxes,
)
from nat2024.datasets.listings import Listing
from nat2024.errors import BoxFileError, FrameUnreadable
from nat2024.types import Image

_DEPTH = 2  # NAT2021/test/anno


@dataclass(frozen=True, slots=True)
class AbsentFrames:
    """In place of frames that are not there; their number is that of the boxes.

    Attributes:
        folder: where they were looked for.
        sequence: name of the sequence, for messages.
        count: number of frames.
    """

    folder: Path
    sequence: str
    count: int

    @property
    def names(self) -> tuple[str, ...]:
        """None."""
        return ()

    @property
    def frame_size(self) -> tuple[int, int]:
        """Not known; `FrameUnreadable`."""
        self._refuse("its frames are not there, and this needs their size")

    def __len__(self) -> int:
        """Number of boxes."""
        return self.count

    def __bool__(self) -> bool:
        """False: there is nothing to read frames from."""
        return False

    def __getitem__(self, index: int, /) -> Image:
        """No frame; `FrameUnreadable`."""
        self._refuse(f"frame {index} is not there, only boxes are")

    def title(self, index: int) -> str:
        """The number of the frame."""
        return f"frame {index}"

    def cut(self, count: int) -> "AbsentFrames":
        """The first `count` of them."""
        return replace(self, count=count)

    def _refuse(self, why: str) -> NoReturn:
        msg = f"{self.sequence}: {why}; looked for in {self.folder}"
        raise FrameUnreadable(msg)


def frameless_sequences(found: Iterable[FoundSequence]) -> list[str]:
    """Names of the sequences whose frames are absent."""
    return [one.name for one in found if isinstance(one.frames, AbsentFrames)]


def with_frameless(layout: Layout) -> Layout:
    """The same layout with the sequences of box files to which there are no frames.

    Box files that cannot be read stay among those without frames.
    """
    if layout.document is not None:  # it counts its frames itself
        return layout
    there = [_if_absent(found) for found in layout.sequences]
    side = SideFiles.of(Listing.of(layout.folder)) if layout.without_frames else None
    more = [one for name in layout.without_frames if side and (one := _annotated(side, name))]
    names = {_stem(one) for one in more}
    left = tuple(name for name in layout.without_frames if name not in names)
    sequences = tuple(sorted([*there, *more], key=lambda one: one.name))
    return replace(layout, sequences=sequences, without_frames=left)


def _if_absent(found: FoundSequence) -> FoundSequence:
    """A sequence with boxes but no frames as such; any other as it is."""
    if found.frames or found.boxes is None:
        return found
    count = _count_boxes(found.boxes)
    frames = AbsentFrames(found.frames.folder, found.name, count)
    return replace(found, frames=frames) if count else found


def find_annotation(folder: Path, depth: int = _DEPTH) -> Layout | None:
    """Box files without any frames: `anno/NAME.txt`, `NAME/groundtruth.txt` or `NAME.txt`.

    Args:
        folder: of the dataset, of its box files, or one that holds one of these alone.
        depth: how many folders may wrap it.
    """
    listing = Listing.of(folder)
    layout = _beside(listing) or _each(listing) or _texts(listing)
    if layout is not None or depth == 0:
        return layout
    inside = [find_annotation(folder / name, depth - 1) for name in listing.folders]
    known = [one for one in inside if one is not None]
    return known[0] if len(known) == 1 else None


def _beside(listing: Listing) -> Layout | None:
    """Box files in a folder of a known name, perhaps beside folders from which the images went."""
    side = SideFiles.of(listing)
    folders = [one for frames in listing.inside(*FRAME_FOLDERS) for one in _children(frames)]
    found = _all_absent(side, folders)
    found += _all_annotated(side, {one.name for one in found})
    if not found:
        return None
    left = tuple(sorted({*side.unused({one.name for one in found})}))
    words = side.words().removeprefix(" + ")
    return replace(make_layout("apart", listing.path, words, found), without_frames=left)


def _each(listing: Listing) -> Layout | None:
    """A folder a sequence, with its box file."""
    found = _all_absent(SideFiles.of(listing), _children(listing))
    return make_layout("each", listing.path, "NAME/*.txt", found) if found else None


def _texts(listing: Listing) -> Layout | None:
    """The folder of box files itself."""
    attributes = listing.inside(*ATTRIBUTE_FOLDERS)
    found = _all_annotated(SideFiles((listing,), (), attributes), set())
    return make_layout("apart", listing.path, "NAME.txt", found) if found else None


def _children(listing: Listing) -> list[Listing]:
    return [listing.child(name) for name in listing.folders]


def _all_absent(side: SideFiles, folders: list[Listing]) -> list[FoundSequence]:
    """The sequences of these folders that have boxes but no frames."""
    looked = [side.sequence(one.path.name, one, own_boxes(one)) for one in folders]
    return [one for one in map(_if_absent, looked) if isinstance(one.frames, AbsentFrames)]


def _all_annotated(side: SideFiles, known: set[str]) -> list[FoundSequence]:
    """The sequences of all other box files."""
    return [one for name in side.unused(known) if (one := _annotated(side, name))]


def _stem(found: FoundSequence) -> str:
    assert found.boxes is not None
    return found.boxes.stem


def _annotated(side: SideFiles, name: str) -> FoundSequence | None:
    """The sequence of a box file; None where that holds no boxes."""
    found = side.annotated(name)
    count = _count_boxes(found.boxes) if found and found.boxes else 0
    if found is None or not count:
        return None
    return replace(found, frames=AbsentFrames(found.folder, found.name, count))


def _count_boxes(path: Path) -> int:
    try:
        return len(read_box_file(path))
    except BoxFileError:
        return 0
