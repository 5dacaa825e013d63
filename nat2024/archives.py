"""Files inside a .zip archive, read in place: nothing is ever extracted.

A path goes through the archive as through a folder: `night.zip/data_seq/a/00001.jpg`. Before any
member is read all names are looked at: those that would lead out of a folder, links, and members
that would unpack to absurd sizes make the whole archive refused.
"""

import errno
import functools
import io
import stat
import struct
import zipfile
import zlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path, PurePosixPath, PureWindowsPath

from nat2024.errors import DatasetIncomplete, DatasetNotFound

MAX_MEMBER_BYTES = 2**29
MAX_CONTENTS_BYTES = 2**27
"""Of a table of contents, which is held in memory: enough for a million frames."""
_MAX_NAME = 1024  # bytes, and
_MAX_DEPTH = 32  # folders: every one of them is remembered with its whole name
_MAX_RATIO = 200
_RATIO_COUNTS_FROM = 2**24  # a small file of equal lines may shrink more and harms nobody
_METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
_LOCAL_HEADER = struct.Struct("<4s22sHH")
_ENCRYPTED = 0x1


@dataclass(frozen=True, slots=True)
class Member:
    """Where the bytes of one file lie in its archive."""

    offset: int
    packed: int
    size: int
    deflated: bool
    checksum: int


@dataclass(frozen=True, slots=True)
class Archive:
    """The table of contents of one archive; holds no open file.

    Attributes:
        path: of the archive.
        folders: names directly inside each folder, as (folders, files); "" is the top.
        members: every file by its name from the top.
    """

    path: Path
    folders: dict[str, tuple[tuple[str, ...], tuple[str, ...]]]
    members: dict[str, Member]

    def read(self, name: str) -> bytes:
        """The bytes of a member.

        Raises:
            OSError: it is not there, or damaged.
        """
        member = self.members.get(name)
        if member is None:
            raise FileNotFoundError(errno.ENOENT, "no such file in the archive")
        with self.path.open("rb") as file:
            # places and sizes may lie, and room would be made for all that is asked for
            if member.offset + member.packed > file.seek(0, io.SEEK_END):
                raise _damaged()
            file.seek(member.offset)
            header = file.read(_LOCAL_HEADER.size)
            if len(header) < _LOCAL_HEADER.size or not header.startswith(b"PK\x03\x04"):
                raise _damaged()
            _, _, name_length, extra_length = _LOCAL_HEADER.unpack(header)
            file.seek(name_length + extra_length, 1)
            data = file.read(member.packed)
        if member.deflated:
            data = _inflate(data, member.size)
        if len(data) != member.size or zlib.crc32(data) != member.checksum:
            raise _damaged()
        return data


def is_archive(path: Path) -> bool:
    """Whether a path leads to a file called .zip."""
    return path.suffix.lower() == ".zip" and path.is_file()


def split_path(path: Path) -> tuple[Path, str] | None:
    """(archive, name inside it) of a path that goes through an archive, else None."""
    for parent in (path, *path.parents):
        if is_archive(parent):
            inner = path.relative_to(parent).as_posix()
            return parent, "" if inner == "." else inner
    return None


def list_archived(path: Path) -> tuple[tuple[str, ...], tuple[str, ...]] | None:
    """(folders, files) directly inside a folder of an archive; None where it is no such folder.

    Raises:
        DatasetNotFound, DatasetIncomplete: as `open_archive`.
    """
    found = split_path(path)
    return open_archive(found[0]).folders.get(found[1]) if found else None


def is_stored(path: Path) -> bool:
    """Whether there is such a file, in a folder or in an archive."""
    if path.is_file():
        return True
    listed = list_archived(path.parent)
    return listed is not None and path.name in listed[1]


def read_bytes(path: Path) -> bytes:
    """The bytes of a file, in a folder or in an archive.

    Raises:
        OSError: it cannot be read.
        DatasetNotFound, DatasetIncomplete: as `open_archive`.
    """
    try:
        return path.read_bytes()
    except (NotADirectoryError, FileNotFoundError):
        found = split_path(path)
        if found is None:
            raise
        return open_archive(found[0]).read(found[1])


def open_archive(path: Path) -> Archive:
    """The table of contents of an archive, read once.

    Raises:
        DatasetNotFound: it cannot be read or is no zip archive.
        DatasetIncomplete: it is refused: a name leads out of a folder or comes twice, a member is
            a link, encrypted, packed by another method than deflate, or unpacks to an absurd size.
    """
    try:
        state = path.stat()
        return _open(path, state.st_size, state.st_mtime_ns)
    except OSError as error:
        msg = f"{path}: cannot be read ({error.strerror})"
        raise DatasetNotFound(msg) from None
    except (zipfile.BadZipFile, NotImplementedError, ValueError, struct.error) as error:
        msg = f"{path}: no zip archive, or a damaged one ({error}); get it again"
        raise DatasetNotFound(msg) from None


class _Bounded(io.BufferedReader):
    """A file of which no more is read at once than a table of contents may take."""

    def read(self, size: int | None = -1, /) -> bytes:
        """As of any file.

        Raises:
            BadZipFile: too much is asked for.
        """
        if size is not None and size > MAX_CONTENTS_BYTES:
            msg = f"its table of contents is said to take {size} bytes"
            raise zipfile.BadZipFile(msg)
        return super().read(size)


@functools.lru_cache(maxsize=4)
def _open(path: Path, _size: int, _changed: int) -> Archive:
    members: dict[str, Member] = {}
    with path.open("rb", buffering=0) as raw, zipfile.ZipFile(_Bounded(raw)) as archive:
        for info in archive.infolist():
            fault = _name_fault(info) or _content_fault(info)
            if not fault and info.filename in members:
                fault = "two members of that name"
            if fault:
                msg = f"{path}: refused, member {info.orig_filename!a:.80}: {fault}"
                raise DatasetIncomplete(msg)
            if not info.is_dir():
                deflated = info.compress_type == zipfile.ZIP_DEFLATED
                members[info.filename] = Member(
                    info.header_offset, info.compress_size, info.file_size, deflated, info.CRC
                )
    return Archive(path, _folders(members), members)


def _name_fault(info: zipfile.ZipInfo) -> str:
    """Why a member's name is not safe, or an empty text."""
    name = info.orig_filename  # as stored: `filename` is cut at a NUL and has its slashes turned
    parts = name.rstrip("/").split("/")
    if "\\" in name or "\0" in name:
        return "a backslash or NUL in the name"
    if PurePosixPath(name).is_absolute() or any(PureWindowsPath(part).drive for part in parts):
        return "the name begins at a root or drive"
    if ".." in parts:
        return "the name leads out of its folder"
    if "" in parts or "." in parts:
        return "a name with empty parts"
    if len(name.encode("utf-8", "replace")) > _MAX_NAME or len(parts) > _MAX_DEPTH:
        return f"more than {_MAX_NAME} bytes of name, or {_MAX_DEPTH} folders deep"
    return ""


def _content_fault(info: zipfile.ZipInfo) -> str:
    """Why a member is not unpacked, or an empty text."""
    kind = stat.S_IFMT(info.external_attr >> 16)
    if kind not in (0, stat.S_IFREG, stat.S_IFDIR):
        return "a link or special file"
    if info.flag_bits & _ENCRYPTED:
        return "encrypted"
    if info.compress_type not in _METHODS:
        return "packed by another method than deflate"
    vast = info.file_size > _RATIO_COUNTS_FROM and info.file_size > _MAX_RATIO * info.compress_size
    if info.header_offset < 0:
        return "said to lie before the beginning of the archive"
    if vast or info.file_size > MAX_MEMBER_BYTES:
        return f"{info.compress_size} bytes that unpack to {info.file_size}"
    return ""


def _folders(names: Iterable[str]) -> dict[str, tuple[tuple[str, ...], tuple[str, ...]]]:
    folders: dict[str, set[str]] = {"": set()}
    files: dict[str, list[str]] = {}
    for name in names:
        parent, _, own = name.rpartition("/")
        files.setdefault(parent, []).append(own)
    for parent in files:
        for folder, holder in _ancestors(parent):
            folders.setdefault(folder, set())
            folders.setdefault(holder, set()).add(folder.rpartition("/")[2])
    return {f: (tuple(sorted(inside)), tuple(files.get(f, ()))) for f, inside in folders.items()}


def _ancestors(folder: str) -> Iterator[tuple[str, str]]:
    """(folder, the folder that holds it) from a folder up to the top."""
    while folder:
        holder = folder.rpartition("/")[0]
        yield folder, holder
        folder = holder


def _inflate(data: bytes, size: int) -> bytes:
    """At most one byte more than `size`, whatever the packed bytes would give."""
    try:
        return zlib.decompressobj(-zlib.MAX_WBITS).decompress(data, size + 1)
    except zlib.error:
        raise _damaged() from None


def _damaged() -> OSError:
    return OSError(errno.EIO, "damaged in the archive")
