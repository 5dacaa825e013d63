"""Folders of results, on disk or inside a .zip archive, looked at alike."""

import errno
import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from nat2024.archives import is_archive, list_archived, open_archive, split_path
from nat2024.boxes import parse_boxes
from nat2024.errors import BoxFileError, NatBenchError
from nat2024.types import Boxes

MAX_BYTES = 2**25
"""Of one result file; the longest public sequence needs less than 1 MB."""

_HEAD = 2**12


@dataclass(frozen=True, slots=True)
class Folder:
    """Names in one folder, hidden ones left out.

    Attributes:
        path: the folder; it may be a .zip archive, or lead through one.
        folders: names of sub-folders, sorted.
        files: names of files, sorted.
    """

    path: Path
    folders: tuple[str, ...]
    files: tuple[str, ...]

    @property
    def name(self) -> str:
        """Its own name, without `.zip`."""
        return self.path.stem if is_archive(self.path) else self.path.name

    def child(self, name: str) -> "Folder":
        """One sub-folder."""
        return open_folder(self.path / name)

    def children(self) -> "Iterator[Folder]":
        """All sub-folders."""
        return map(self.child, self.folders)

    def texts(self) -> tuple[str, ...]:
        """Names of the text files."""
        return tuple(name for name in self.files if name.lower().endswith(".txt"))


def open_folder(path: Path) -> Folder:
    """List a folder, an archive, or a folder inside one; empty where it is none of them.

    Raises:
        DatasetNotFound, DatasetIncomplete: an archive that cannot be read or is refused.
    """
    if path.is_dir():
        try:
            with os.scandir(path) as entries:
                found = [(entry.name, entry.is_dir()) for entry in entries]
        except OSError as error:
            msg = f"{path}: cannot be listed ({error.strerror})"
            raise BoxFileError(msg) from None
        folders = [name for name, is_folder in found if is_folder]
        files = [name for name, is_folder in found if not is_folder]
    else:
        listed = list_archived(path)
        folders, files = map(list, listed) if listed else ([], [])
    return Folder(path, _shown(folders), _shown(files))


def _shown(names: list[str]) -> tuple[str, ...]:
    return tuple(sorted(n for n in names if not n.startswith(".") and n != "__MACOSX"))


def is_folder(path: Path) -> bool:
    """Whether there is a folder, an archive, or a folder inside one."""
    return path.is_dir() or list_archived(path) is not None


def read_file(path: Path) -> bytes:
    """The bytes of a result file, in a folder or in an archive.

    Raises:
        BoxFileError: it cannot be read or is too large to be one.
    """
    try:
        with open(path, "rb") as file:  # noqa: PTH123 (half the time for a thousand of small files)
            _check_size(path, os.fstat(file.fileno()).st_size)
            return file.read()
    except (NotADirectoryError, FileNotFoundError):
        return _read_archived(path)
    except OSError as error:
        msg = f"{path}: cannot be read ({error.strerror})"
        raise BoxFileError(msg) from None


def _read_archived(path: Path) -> bytes:
    found = split_path(path)
    try:
        if found is None:
            raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT))
        archive = open_archive(found[0])
        member = archive.members.get(found[1])
        _check_size(path, member.size if member else 0)
        return archive.read(found[1])
    except OSError as error:
        msg = f"{path}: cannot be read ({error.strerror})"
        raise BoxFileError(msg) from None


def _check_size(path: Path, size: int) -> None:
    if size > MAX_BYTES:
        msg = f"{path}: {size} bytes, too large for a result file"
        raise BoxFileError(msg)


def parse_text(raw: bytes, path: Path) -> Boxes:
    """Boxes of a text file, with every separator that writers use; see `nat2024.read_boxes`."""
    return parse_boxes(raw, source=str(path))


def read_head(path: Path) -> str:
    """The beginning of a text file, empty where it cannot be read."""
    try:
        return read_file(path)[:_HEAD].decode("utf-8", "replace")
    except NatBenchError:
        return ""


def has_tabs(path: Path) -> bool:
    """Whether the first line of a text is parted by tabs, as pytracking's are."""
    first, _, _ = read_head(path).partition("\n")
    return "\t" in first and "," not in first
