"""Frames of a folder, decoded only when asked for."""

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import SupportsIndex

from nat2024.datasets.decoding import decode_image, image_size
from nat2024.errors import FrameUnreadable
from nat2024.types import Image

IMAGE_EXTENSIONS = frozenset({".jpg", ".jpeg", ".png", ".bmp"})
_DIGITS = re.compile(r"([0-9]+)")


@dataclass(frozen=True, slots=True)
class FolderFrames:
    """The images of one folder, in natural order of their names; a `FrameSource`.

    Cheap to make and to send to another process: it holds names, never pixels.

    Attributes:
        folder: where the images lie.
        names: file names in frame order.
    """

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
        path = self.path(index)
        return decode_image(_read(path, index), _where(path, index))

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
        path = self.path(0)
        data = _read(path, 0)
        size = image_size(data)
        if size is None:
            height, width = decode_image(data, _where(path, 0)).shape[:2]
            size = (width, height)
        return size

    def cut(self, count: int) -> "FolderFrames":
        """The first `count` frames."""
        return FolderFrames(self.folder, self.names[:count])


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


def _read(path: Path, index: SupportsIndex) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        msg = f"{_where(path, index)}: cannot be read ({error.strerror})"
        raise FrameUnreadable(msg) from None
