"""What lies in a folder: sub-folders, images in frame order, other files."""

import os
import stat
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from nat2024.archives import list_archived
from nat2024.datasets.frames import image_names
from nat2024.datasets.video import VIDEO_EXTENSIONS
from nat2024.errors import DatasetNotFound


@dataclass(frozen=True, slots=True)
class Listing:
    """Names in one folder, hidden ones left out; look-ups take any case, the exact one first.

    Attributes:
        path: the folder.
        folders: names of sub-folders, sorted.
        images: names of images in frame order.
        files: names of all other files, sorted.
        links: names of images and other files that are symbolic links (or no files at all).
    """

    path: Path
    folders: tuple[str, ...]
    images: tuple[str, ...]
    files: tuple[str, ...]
    links: frozenset[str]
    _found: dict[str, str]

    @classmethod
    def of(cls, path: Path) -> "Listing":
        """List a folder, or a folder inside an archive.

        Raises:
            DatasetNotFound: it cannot be listed.
            DatasetIncomplete: it lies in an archive that is refused.
        """
        folders, names, links = _scan(path)
        images = image_names(names)
        files = sorted(set(names).difference(images))
        return cls(
            path,
            tuple(sorted(folders)),
            images,
            tuple(files),
            frozenset(links),
            _in_any_case(files),
        )

    @property
    def videos(self) -> tuple[str, ...]:
        """Names of video files, sorted."""
        return tuple(f for f in self.files if Path(f).suffix.lower() in VIDEO_EXTENSIONS)

    @property
    def is_empty(self) -> bool:
        """Whether there is nothing but hidden files."""
        return not (self.folders or self.images or self.files)

    def child(self, name: str) -> "Listing":
        """The listing of one sub-folder."""
        return Listing.of(self.path / name)

    def inside(self, *names: str) -> "tuple[Listing, ...]":
        """Listings of those of these sub-folders that are there, in the order of `names`."""
        found = _in_any_case(self.folders)
        return tuple(self.child(found[name]) for name in names if name in found)

    def file(self, *names: str) -> Path | None:
        """The first of these files that is there."""
        for name in names:
            actual = self._found.get(name) or self._found.get(name.lower())
            if actual:
                return self.path / actual
        return None


def _scan(path: Path) -> tuple[list[str], list[str], list[str]]:
    """Names of folders, of files, and of those files that are links; hidden ones left out."""
    folders: list[str] = []
    names: list[str] = []
    links: list[str] = []
    try:
        with os.scandir(path) as scan:
            for entry in scan:
                name = entry.name
                if name[0] == ".":
                    continue
                if entry.is_file(follow_symlinks=False):  # nearly all of them
                    names.append(name)
                elif (path / name).is_dir():
                    folders.append(name)
                else:
                    names.append(name)
                    links.append(name)
    except OSError as error:
        archived = list_archived(path)
        if archived is not None:
            folders, names = ([n for n in part if n[0] != "."] for part in archived)
            return folders, names, []
        msg = f"{path}: cannot be listed ({error.strerror})"
        raise DatasetNotFound(msg) from None
    return folders, names, links


def path_kind(path: Path) -> Literal["absent", "file", "folder"]:
    """What a path leads to; whatever the system refuses to look at counts as absent."""
    try:
        return "folder" if stat.S_ISDIR(path.stat().st_mode) else "file"
    except (OSError, ValueError):  # no such file, no permission, a name too long, a NUL in it
        return "absent"


def _in_any_case(names: Iterable[str]) -> dict[str, str]:
    """Names by themselves and by their small letters; a name's own spelling goes before."""
    names = list(names)
    return {name.lower(): name for name in reversed(names)} | {name: name for name in names}
