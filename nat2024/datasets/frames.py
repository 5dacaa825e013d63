"""Frames of a folder, decoded only when asked for; also of a folder inside a .zip archive."""

import re
from dataclasses import dataclass, field
from operator import methodcaller
from pathlib import Path
from typing import ClassVar, Protocol, SupportsIndex, runtime_checkable

from nat2024.archives import read_bytes
from nat2024.datasets.decoding import check_reduction, decode_image, image_size, shrink, size_fault
from nat2024.errors import FrameUnreadable
from nat2024.types import FrameSource, Image

IMAGE_EXTENSIONS = frozenset({".jpg", ".jpeg", ".png", ".bmp"})
_DIGITS = re.compile(r"([0-9]+)")
_HEADER_BYTES = 4096  # holds the size, unless a thumbnail or colour profile goes before it


class StoredFrames(FrameSource, Protocol):
    """Frames of one sequence of a dataset on disk: a folder of images or a video."""

    @property
    def folder(self) -> Path:
        """Where the images, or the video, lie."""
        ...

    @property
    def names(self) -> tuple[str, ...]:
        """File names in frame order; empty for a video."""
        ...

    def __bool__(self) -> bool:
        """Whether there is something to read frames from; decodes nothing."""
        ...

    def title(self, index: int) -> str:
        """What to call frame `index` (0-based) in a line for people."""
        ...

    def cut(self, count: int) -> "StoredFrames":
        """The first `count` frames."""
        ...


@runtime_checkable
class Reducing(Protocol):
    """Frames that can be decoded at a reduced size in less time."""

    def thumbnail(self, index: int, reduction: int) -> Image:
        """As `read_reduced`."""
        ...


@dataclass(frozen=True, slots=True)
class FolderFrames:
    """The images of one folder, in natural order of their names; a `FrameSource`.

    Cheap to make and to send to another process: it holds names, never pixels.

    Attributes:
        folder: where the images lie.
        names: file names in frame order.
        reads_in_parallel: several threads may read frames at the same time.
    """

    reads_in_parallel: ClassVar[bool] = True

    folder: Path
    names: tuple[str, ...]
    _size: tuple[int, int] | None = field(default=None, init=False, repr=False, compare=False)

    def __len__(self) -> int:
        """Number of frames."""
        return len(self.names)

    def __getitem__(self, index: SupportsIndex, /) -> Image:
        """Frame `index` (0-based), uint8 (H, W, 3) BGR; grey images get three equal channels.

        EXIF orientation is ignored, in the pixels and in `frame_size`; the official code differs:
        `cv2.imread` turns such images (the released frames carry no orientation).

        Raises:
            FrameUnreadable: the file is absent, truncated or no image; names file and frame.
        """
        return self.thumbnail(index)

    def __bool__(self) -> bool:
        """Whether there are any."""
        return bool(self.names)

    def thumbnail(self, index: SupportsIndex, reduction: int = 1) -> Image:
        """Frame `index` (0-based) `reduction` times smaller (1, 2, 4, 8); see `read_reduced`."""
        path = self.path(index)
        return decode_image(_read(path, index), _where(path, index), reduction)

    def title(self, index: SupportsIndex) -> str:
        """File name of frame `index` (0-based)."""
        return self.names[index]

    def path(self, index: SupportsIndex) -> Path:
        """File of frame `index` (0-based)."""
        return self.folder / self.names[index]

    @property
    def frame_size(self) -> tuple[int, int]:
        """(width, height) of the first frame in pixels, read from its header.

        Raises:
            FrameUnreadable: there is no frame, or the first is no image.
        """
        if self._size is None:
            object.__setattr__(self, "_size", self._read_size())
        return self._size  # type: ignore[return-value]

    def _read_size(self) -> tuple[int, int]:
        if not self.names:
            msg = f"{self.folder}: no images in it"
            raise FrameUnreadable(msg)
        return self.size_of(0)

    def size_of(self, index: SupportsIndex) -> tuple[int, int]:
        """(width, height) of frame `index` (0-based), read from its header.

        Raises:
            FrameUnreadable: it is absent, no image, or claims too many pixels to be decoded.
        """
        path = self.path(index)
        start = _read_start(path, index)
        if not start:
            msg = f"{_where(path, index)}: the file is empty"
            raise FrameUnreadable(msg)
        size = image_size(start)
        if size is None:
            data = _read(path, index)
            size = image_size(data)
        if size is None:
            height, width = decode_image(data, _where(path, index)).shape[:2]
            size = (width, height)
        fault = size_fault(size)
        if fault:
            msg = f"{_where(path, index)}: {fault}; get this file again"
            raise FrameUnreadable(msg)
        return size

    def cut(self, count: int) -> "FolderFrames":
        """The first `count` frames."""
        return FolderFrames(self.folder, self.names[:count])


def read_reduced(frames: FrameSource, index: int, reduction: int) -> Image:
    """Frame `index` made `reduction` times smaller in both directions.

    JPEG files are decoded at that size, which takes a fraction of the time; all others are decoded
    whole and averaged over areas.

    Args:
        frames: of a sequence.
        index: 0-based.
        reduction: 1, 2, 4 or 8.

    Returns:
        uint8 (ceil(H / reduction), ceil(W / reduction), 3) BGR.

    Raises:
        FrameUnreadable: the frame cannot be decoded.
        UsageError: another reduction.
    """
    check_reduction(reduction)
    if isinstance(frames, Reducing):
        return frames.thumbnail(index, reduction)
    return shrink(frames[index], reduction)


def count_frames(frames: FrameSource) -> int:
    """Number of frames, 0 for a video that cannot be opened."""
    try:
        return len(frames)
    except FrameUnreadable:
        return 0


def same_number(names: tuple[str, ...]) -> tuple[str, str] | None:
    """Two images that are the same frame by their names (`1.jpg`, `00001.png`), if there are."""
    ending = names[0][names[0].rfind(".") :] if names else ""
    if len(set(map(len, names))) < 2 and all(map(methodcaller("endswith", ending), names)):
        return None  # as in every published dataset
    seen: dict[tuple[str | int, ...], str] = {}
    for name in names:
        key = tuple(_natural(name.rpartition(".")[0])[0])
        if key in seen:
            return seen[key], name
        seen[key] = name
    return None


def image_names(names: list[str]) -> tuple[str, ...]:
    """The image files among `names`, in natural order: `2.jpg` before `10.jpg`.

    Other files (`Thumbs.db`) and hidden ones (`._00001.jpg`) are left out.
    """
    kept = [name for name in names if _is_image(name)]
    stems = [name.rpartition(".")[0] for name in kept]
    same_length = len({len(stem) for stem in stems}) == 1
    if same_length and all(stem.isascii() and stem.isdigit() for stem in stems):
        return tuple(sorted(kept))  # the same order without splitting 100 000 names
    return tuple(sorted(kept, key=_natural))


def _is_image(name: str) -> bool:
    dot = name.rfind(".")
    return dot > 0 and name[0] != "." and name[dot:].lower() in IMAGE_EXTENSIONS


def _natural(name: str) -> tuple[list[str | int], str]:
    parts = _DIGITS.split(name)
    return [int(part) if i % 2 else part for i, part in enumerate(parts)], name


def _where(path: Path, index: SupportsIndex) -> str:
    return f"{path} (frame {index.__index__()}, counted from 0)"


def _read_start(path: Path, index: SupportsIndex) -> bytes:
    """The first bytes of a file; of a member of an archive all of them."""
    try:
        with path.open("rb") as file:
            return file.read(_HEADER_BYTES)
    except OSError:
        return _read(path, index)


def _read(path: Path, index: SupportsIndex) -> bytes:
    try:
        return read_bytes(path)
    except OSError as error:
        msg = f"{_where(path, index)}: cannot be read ({error.strerror})"
        raise FrameUnreadable(msg) from None
