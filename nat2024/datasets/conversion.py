"""Between formats, without losing a value: what `nat-bench dataset convert` does."""

import errno
import os
import shutil
from collections.abc import Iterable, Iterator
from pathlib import Path, PurePosixPath
from typing import Literal

import msgspec

from nat2024.archives import read_bytes
from nat2024.datasets.conversion_source import Source, read_source
from nat2024.datasets.converters import CONVERTERS
from nat2024.datasets.converters.common import iterate_once
from nat2024.datasets.described import get_converter
from nat2024.datasets.file_names import is_inner_path
from nat2024.datasets.schema import AnnotatedDataset
from nat2024.errors import AnnotationInvalid, FrameUnreadable, UsageError
from nat2024.files import write_atomic

FORMATS = tuple(CONVERTERS)
"""Formats that `convert` writes."""

FRAME_MODES = ("copy", "link", "none")
"""What can become of the frames; see `convert`."""

_WITH_VIDEO = ("index", "published")
_NO_LINK = (errno.EXDEV, errno.EPERM, errno.EMLINK, errno.ENOTSUP, errno.ENOTDIR)


class Conversion(msgspec.Struct, frozen=True, kw_only=True):
    """What `convert` did.

    Attributes:
        name: of the dataset.
        source: the format that was read, in words.
        format: that was written.
        out: the folder.
        sequences: number of sequences.
        frames: number of frames that they have.
        copied: frame files that were copied.
        linked: frame files that are hard links to those of the source.
        annotation_files: number of other files.
        remarks: what could not be kept, one line each.
    """

    name: str
    source: str
    format: str
    out: str
    sequences: int
    frames: int
    copied: int
    linked: int
    annotation_files: int
    remarks: tuple[str, ...] = ()


def convert(
    source: str | os.PathLike[str],
    out: str | os.PathLike[str],
    to: str,
    *,
    root: str | os.PathLike[str] | None = None,
    source_format: str | None = None,
    frames: str = "copy",
) -> Conversion:
    """Write a dataset in another format into a new folder.

    What the format has no field for goes into a side file (`nat-bench-extra.json`, or
    `info.nat_bench` of COCO-video JSON), so that converting back gives an equal index.

    Args:
        source: as `name_or_path` of `load_dataset`; sequences without boxes come along.
        out: folder that is empty or absent.
        to: one of `FORMATS`.
        root: as in `load_dataset`.
        source_format: take `source` for this format; None finds it out.
        frames: "copy" the frames; "link" them by hard links, which take no space (copied where
            the file system has none, as to another disk); or "none": annotation alone.

    Raises:
        UsageError: no such format, the folder is not empty, or the format holds no videos.
        AnnotationInvalid: names that cannot be written, or that would leave the folder.
        FrameUnreadable: a frame cannot be copied.
        DatasetNotFound, DatasetIncomplete: as `load_dataset`.
    """
    converter, out = get_converter(to), Path(out)
    if frames not in FRAME_MODES:
        msg = f"frames {frames!r} is none of {', '.join(FRAME_MODES)}"
        raise UsageError(msg)
    if os.path.lexists(out) and (not out.is_dir() or any(out.iterdir())):
        msg = f"{out} is not an empty folder; choose another one"
        raise UsageError(msg)
    found = read_source(
        source, root, source_format, with_frames=frames != "none", checksums=to == "index"
    )
    document = found.document
    _refuse_videos(document, to)
    files = list(iterate_once(_inner(converter.files(document))))
    paths = converter.frame_paths(document)
    moves = dict(_moves(found, paths, {path.lower() for path, _ in files}))
    _refuse_folders([*moves, *(path for path, _ in files)])
    counts = {"copied": 0, "linked": 0}
    if frames != "none":
        for path, frame in moves.items():
            counts[_place(frame, out / path, link=frames == "link")] += 1
    for path, data in files:
        write_atomic(out / path, data)
    out.mkdir(parents=True, exist_ok=True)
    return Conversion(
        name=document.name,
        source=found.words,
        format=to,
        out=str(out),
        sequences=len(document.sequences),
        frames=sum(s.frames.count for s in document.sequences),
        copied=counts["copied"],
        linked=counts["linked"],
        annotation_files=len(files),
        remarks=found.remarks,
    )


def _refuse_videos(document: AnnotatedDataset, to: str) -> None:
    videos = [s.name for s in document.sequences if s.frames.video]
    if videos and to not in _WITH_VIDEO:
        msg = f"sequence {videos[0]} is a video, but {to} holds folders of images; decode it first"
        raise UsageError(msg)


def _inner(files: Iterable[tuple[str, bytes]]) -> Iterator[tuple[str, bytes]]:
    for path, data in files:
        _refuse_outer(path)
        yield path, data


def _refuse_outer(path: str) -> None:
    if not path or not is_inner_path(path):
        msg = f"{path!r} would lead out of the output folder, or is no plain file name"
        raise AnnotationInvalid(msg)


def _moves(
    found: Source, paths: dict[str, tuple[str, ...]], taken: set[str]
) -> Iterator[tuple[str, Path]]:
    """Where each frame file goes and where it is; sequences may share their frames."""
    seen: dict[str, Path] = {}
    for name, targets in paths.items():
        for path, frame in zip(targets, found.frames[name], strict=True):
            _refuse_outer(path)
            key = path.lower()
            if key in taken or seen.setdefault(key, frame) != frame:
                msg = f"sequence {name}: two files would be called {path}; rename a sequence"
                raise AnnotationInvalid(msg)
            yield path, frame


def _refuse_folders(paths: list[str]) -> None:
    """Raise where a file would be called as the folder of another."""
    files = {path.lower() for path in paths}
    nearest = {PurePosixPath(file).parent for file in files}
    folders = {str(folder) for inner in nearest for folder in (inner, *inner.parents)}
    clash = min(files & folders, default=None)
    if clash is not None:
        msg = f"{clash} would be both a file and a folder; rename a sequence"
        raise AnnotationInvalid(msg)


def _place(frame: Path, target: Path, *, link: bool) -> Literal["copied", "linked"]:
    """Put a frame at its place; links in the source are followed, never made."""
    target.parent.mkdir(parents=True, exist_ok=True)
    try:
        if link and not frame.is_symlink():
            try:
                os.link(frame, target)
            except OSError as error:
                if error.errno not in _NO_LINK:
                    raise
            else:
                return "linked"
        if frame.is_file():
            shutil.copyfile(frame, target)
        else:
            target.write_bytes(read_bytes(frame))
    except OSError as error:
        msg = f"{frame}: cannot be copied to {target} ({error.strerror})"
        raise FrameUnreadable(msg) from None
    return "copied"
