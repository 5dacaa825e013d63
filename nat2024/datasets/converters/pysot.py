"""The JSON of the pysot toolkit for OTB, UAV123, LaSOT and others: one object a video.

`{"NAME": {"video_dir": "NAME", "init_rect": [x, y, w, h], "img_names": ["NAME/00001.jpg", ...],
"gt_rect": [[x, y, w, h], ...], "attr": ["FM", ...], "absent": [1, ...]}, ...}`

The file uses the words `NaN` and `Infinity`, as Python's `json` does. `absent` is what the toolkit
takes it for: it scores the frames whose flag is 1, so 1 means that the target is there. All else is
in `nat-bench-extra.json` beside it.
"""

import json
from collections.abc import Iterator, Mapping
from pathlib import Path, PurePosixPath
from typing import Any

import msgspec
import numpy as np

from nat2024.datasets.converters.common import (
    EXTRA_FILE,
    Described,
    below,
    extra_file,
    find_extra,
    merge,
    numbered,
    read_extra,
)
from nat2024.datasets.file_names import is_inner_path, is_plain_name
from nat2024.datasets.records import all_boxes, frame_files, rows_of, stored_frames
from nat2024.datasets.schema import (
    INDEX_FILE,
    AnnotatedDataset,
    AnnotatedSequence,
    AttributeTerm,
    KeptSequence,
    read_bytes,
)
from nat2024.datasets.schema_checks import check_dataset
from nat2024.errors import AnnotationInvalid
from nat2024.types import Boxes

FORMAT = "pysot"

_KNOWN = ("video_dir", "init_rect", "img_names", "gt_rect", "attr", "absent")
_RESERVED = {INDEX_FILE, EXTRA_FILE}


class Video(msgspec.Struct, frozen=True):
    """One video of the file; what is not named here is kept as text."""

    img_names: tuple[str, ...]
    gt_rect: tuple[tuple[float, ...], ...] = ()
    video_dir: str = ""
    init_rect: tuple[float, ...] = ()
    attr: tuple[str, ...] = ()
    absent: tuple[int, ...] | None = None


def find(folder: Path) -> Path | None:
    """The side file, if the folder holds one of this format."""
    return find_extra(folder, FORMAT)


def recognise(raw: bytes) -> bool:
    """Whether JSON looks like a file of this format."""
    head = raw.lstrip()[:1]
    return head == b"{" and b'"img_names"' in raw and b'"gt_rect"' in raw


def read(path: Path, base: Path) -> Described:
    """Read a file of this format, or the dataset to which a side file belongs."""
    if path.name != EXTRA_FILE:
        return read_foreign(path, base)
    found = read_extra(path)
    source = base / _file_name(found)
    videos = read_videos(source)

    def native(sequence: KeptSequence) -> Mapping[str, Any]:
        if sequence.name not in videos:
            msg = f"{source}: no video {sequence.name!r}, but {path.name} names it"
            raise AnnotationInvalid(msg)
        video = videos[sequence.name][0]
        boxes = _boxes(video, f"{source}: video {sequence.name}")
        return {"boxes": rows_of(boxes), "visible": video.absent}

    document = merge(found, str(source), native)
    names = {s.name: numbered(s) for s in document.sequences}
    frames = {s: stored_frames(base, frame_files(s, found)) for s, found in names.items()}
    return Described(document, frames, base, f"pysot JSON {source.name} + {path.name}")


def read_foreign(path: Path, base: Path) -> Described:
    """Read a file that another program wrote."""
    videos = read_videos(path)
    sequences = tuple(
        _sequence(name, video, rest, f"{path}: video {name}")
        for name, (video, rest) in videos.items()
    )
    terms = dict.fromkeys(a for s in sequences for a in s.attributes)
    document = AnnotatedDataset(
        name=path.stem,
        attributes=tuple(AttributeTerm(name=term) for term in sorted(terms)),
        sequences=sequences,
    )
    document = check_dataset(document, str(path))
    frames = {s.name: stored_frames(base, s.frames) for s in document.sequences}
    return Described(document, frames, base, f"pysot JSON {path.name}")


def read_videos(path: Path) -> dict[str, tuple[Video, dict[str, Any]]]:
    """The videos of a file by name, each with the fields that are not of `Video`.

    Raises:
        AnnotationInvalid: no JSON, or not of this format; names the field.
    """
    try:
        plain = json.loads(read_bytes(path))
        videos = msgspec.convert(plain, dict[str, Video])
    except (ValueError, RecursionError) as error:
        msg = f"{path}: no pysot JSON ({error})"
        raise AnnotationInvalid(msg) from None
    if not videos:
        msg = f"{path}: no video in it"
        raise AnnotationInvalid(msg)
    return {
        name: (video, {k: v for k, v in plain[name].items() if k not in _KNOWN})
        for name, video in videos.items()
    }


def _sequence(name: str, video: Video, rest: dict[str, Any], where: str) -> AnnotatedSequence:
    paths = [PurePosixPath(image) for image in video.img_names]
    folders = {str(path.parent).removeprefix(".") for path in paths}
    if not all(map(is_inner_path, video.img_names)):
        msg = f"{where}: img_names lead out of the dataset's folder, or are no plain paths"
        raise AnnotationInvalid(msg)
    if len(folders) != 1:
        msg = f"{where}: its images lie in {len(folders)} folders, expected one"
        raise AnnotationInvalid(msg)
    if any(flag not in (0, 1) for flag in video.absent or ()):
        msg = f"{where}: absent: expected 0 and 1"
        raise AnnotationInvalid(msg)
    boxes = _boxes(video, where)
    return AnnotatedSequence(
        name=name,
        frames=frame_files(folders.pop(), tuple(path.name for path in paths)),
        boxes=rows_of(boxes) if len(boxes) else None,
        visible=video.absent,  # type: ignore[arg-type]
        attributes=dict.fromkeys(video.attr, "published"),
        extra={
            f"pysot.{key}": json.dumps(value, ensure_ascii=False) for key, value in rest.items()
        },
    )


def _boxes(video: Video, where: str) -> Boxes:
    if not video.gt_rect:
        return np.empty((0, 4))
    widths = {len(row) for row in video.gt_rect}
    if len(widths) != 1 or not widths <= {4, 8}:
        msg = f"{where}: gt_rect: expected rows of 4 numbers"
        raise AnnotationInvalid(msg)
    rows = np.array(video.gt_rect, dtype=np.float64)
    if rows.shape[1] == 4:
        return rows
    x, y = rows[:, 0::2], rows[:, 1::2]  # polygons, as in files of VOT
    left, top = x.min(axis=1), y.min(axis=1)
    return np.stack([left, top, x.max(axis=1) - left, y.max(axis=1) - top], axis=1)


def frame_paths(document: AnnotatedDataset) -> dict[str, tuple[str, ...]]:
    """`NAME/` with the names that the frames have."""
    return {s.name: below(s.name, numbered(s)) for s in document.sequences}


def files(document: AnnotatedDataset) -> Iterator[tuple[str, bytes]]:
    """`DATASET.json`, then the side file."""
    videos = {s.name: _video(s, document.attribute_names) for s in document.sequences}
    text = json.dumps(videos, ensure_ascii=False, separators=(",", ":"))
    yield _file_name(document), f"{text}\n".encode()
    yield extra_file(document, FORMAT, _native)


def _file_name(document: AnnotatedDataset) -> str:
    name = f"{document.name}.json"
    return f"{document.name}_pysot.json" if name in _RESERVED else name


def _native(sequence: AnnotatedSequence) -> tuple[str, ...]:
    rows = ("boxes",) if sequence.boxes is not None and sequence.keyframes is None else ()
    return rows if sequence.visible is None else (*rows, "visible")


def _video(sequence: AnnotatedSequence, order: tuple[str, ...]) -> dict[str, Any]:
    rows = all_boxes(sequence).tolist()
    found: dict[str, Any] = {
        "video_dir": sequence.name,
        "init_rect": rows[0] if rows else [],
        "img_names": list(below(sequence.name, numbered(sequence))),
        "gt_rect": rows,
        "attr": [name for name in order if name in sequence.attributes],
    }
    if sequence.visible is not None:
        found["absent"] = list(sequence.visible)
    for key, value in sequence.extra.items():
        field = key.removeprefix("pysot.")
        if field != key and field not in found and is_plain_name(field):
            found[field] = _json_value(value)
    return found


def _json_value(text: str) -> Any:
    try:
        return json.loads(text)
    except ValueError:
        return text
