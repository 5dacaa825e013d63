"""COCO-video JSON: `videos`, `images`, `annotations`, `categories` and `tracks` with ids from 1.

`annotations.json` lies beside the folders of frames. A frame without target has no annotation; so
has a frame whose box is not four finite numbers, which then stands in `info.nat_bench` with all
else that the format has no field for.
"""

import math
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path, PurePosixPath
from typing import Any

import msgspec
import numpy as np

from nat2024.archives import is_stored
from nat2024.datasets.converters.common import Described, below, kept, merge, numbered
from nat2024.datasets.file_names import is_inner_path
from nat2024.datasets.frames import FolderFrames
from nat2024.datasets.records import all_boxes, frame_files, stored_frames
from nat2024.datasets.schema import (
    AnnotatedDataset,
    AnnotatedSequence,
    FrameFiles,
    KeptDataset,
    Row,
    read_bytes,
)
from nat2024.datasets.schema_checks import check_dataset
from nat2024.errors import AnnotationInvalid

FORMAT = "coco-video"
FILE = "annotations.json"

_UNKNOWN = "target"
_ABSENT: Row = (None, None, None, None)
_IMAGE_FOLDERS = ("data", "images", "frames", "JPEGImages")


class Info(msgspec.Struct, frozen=True):
    """`info`, with our side field."""

    description: str = ""
    version: str = ""
    nat_bench: KeptDataset | None = None


class Video(msgspec.Struct, frozen=True):
    """One entry of `videos`."""

    id: int
    name: str
    width: int | None = None
    height: int | None = None
    fps: float | None = None


class Picture(msgspec.Struct, frozen=True):
    """One entry of `images`."""

    id: int
    file_name: str
    video_id: int
    frame_id: int | None = None
    width: int | None = None
    height: int | None = None


class Annotation(msgspec.Struct, frozen=True):
    """One entry of `annotations`."""

    image_id: int
    bbox: tuple[float, float, float, float]
    category_id: int = 0
    track_id: int | None = None
    instance_id: int | None = None

    @property
    def track(self) -> int:
        """Number of the target in its video."""
        number = self.track_id if self.track_id is not None else self.instance_id
        return 0 if number is None else number


class Category(msgspec.Struct, frozen=True):
    """One entry of `categories`."""

    id: int
    name: str


class CocoVideo(msgspec.Struct, frozen=True):
    """The whole file; fields that are not named here are not read."""

    videos: tuple[Video, ...]
    images: tuple[Picture, ...]
    annotations: tuple[Annotation, ...] = ()
    categories: tuple[Category, ...] = ()
    info: Info = Info()


def find(folder: Path) -> Path | None:
    """`annotations.json` in a folder, if it holds our side field."""
    path = folder / FILE
    return path if is_stored(path) and b'"nat_bench"' in read_bytes(path) else None


def recognise(raw: bytes) -> bool:
    """Whether JSON looks like a file of this format."""
    parts = (b'"videos"', b'"images"', b'"annotations"')
    return raw.lstrip()[:1] == b"{" and all(part in raw for part in parts)


def read(path: Path, base: Path) -> Described:
    """Read a file of this format; frames lie below `base`."""
    try:
        coco = msgspec.json.decode(read_bytes(path), type=CocoVideo)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        msg = f"{path}: no COCO-video JSON ({error})"
        raise AnnotationInvalid(msg) from None
    if coco.info.nat_bench is None:
        return _read_foreign(coco, path, base)
    found = check_dataset(coco.info.nat_bench, str(path), complete=False)
    rows = _rows(coco, found, str(path))
    document = merge(found, str(path), lambda s: {"boxes": rows[s.name]})
    frames = {s.name: FolderFrames(base / s.name, numbered(s)) for s in document.sequences}
    return Described(document, frames, base, f"COCO-video JSON {path.name}")


def _rows(coco: CocoVideo, found: KeptDataset, where: str) -> dict[str, tuple[Row, ...]]:
    """Boxes of the sequences by name, absent where a frame has no annotation."""
    videos = {video.id: video.name for video in coco.videos}
    rows = {s.name: [_ABSENT] * s.frames.count for s in found.sequences}
    at = {i.id: (videos.get(i.video_id, ""), i.frame_id or 0) for i in coco.images}
    for annotation in coco.annotations:
        name, frame = at.get(annotation.image_id, ("", 0))
        if not 0 <= frame < len(rows.get(name, ())):
            msg = f"{where}: annotation of image {annotation.image_id}, which no sequence has"
            raise AnnotationInvalid(msg)
        rows[name][frame] = annotation.bbox
    return {name: tuple(boxes) for name, boxes in rows.items()}


def frame_paths(document: AnnotatedDataset) -> dict[str, tuple[str, ...]]:
    """`NAME/` with the names that the frames have."""
    return {s.name: below(s.name, numbered(s)) for s in document.sequences}


def files(document: AnnotatedDataset) -> Iterator[tuple[str, bytes]]:
    """`annotations.json`."""
    names = sorted({s.category or _UNKNOWN for s in document.sequences})
    categories = {name: number for number, name in enumerate(names, 1)}
    parts: dict[str, list[Any]] = {"videos": [], "images": [], "annotations": [], "tracks": []}
    for number, sequence in enumerate(document.sequences, 1):
        category = categories[sequence.category or _UNKNOWN]
        _add_sequence(parts, document, sequence, number, category)
    info = {
        "description": document.title or document.name,
        "version": document.version,
        "nat_bench": kept(document, FORMAT, _native),
    }
    listed = [{"id": number, "name": name} for name, number in categories.items()]
    licences = [{"id": 1, "name": document.licence, "url": ""}] if document.licence else []
    whole = {"info": info, "licenses": licences, "categories": listed, **parts}
    yield FILE, msgspec.json.encode(whole)


def _native(sequence: AnnotatedSequence) -> tuple[str, ...]:
    if sequence.boxes is None or sequence.keyframes is not None:
        return ()
    return ("boxes",) if all(row == _ABSENT or _is_finite(row) for row in sequence.boxes) else ()


def _is_finite(row: Row) -> bool:
    return all(isinstance(value, float | int) and math.isfinite(value) for value in row)


def _add_sequence(
    parts: dict[str, list[Any]],
    document: AnnotatedDataset,
    sequence: AnnotatedSequence,
    number: int,
    category: int,
) -> None:
    width, height = sequence.resolution or document.resolution or (0, 0)
    size = {"width": width, "height": height}
    video = {"id": number, "name": sequence.name, **size}
    fps = sequence.fps or document.fps
    parts["videos"].append({**video, "fps": fps} if fps else video)
    track = {"id": number, "video_id": number, "category_id": category}
    parts["tracks"].append(track)
    boxes = all_boxes(sequence)
    rows = boxes.tolist()
    finite: list[bool] = np.atleast_1d(np.isfinite(boxes).all(axis=1)).tolist()
    for frame, path in enumerate(below(sequence.name, numbered(sequence))):
        image = {"id": len(parts["images"]) + 1, "file_name": path, "video_id": number}
        parts["images"].append({**image, "frame_id": frame, **size})
        if frame < len(rows) and finite[frame]:
            area = rows[frame][2] * rows[frame][3]
            annotation = {"id": len(parts["annotations"]) + 1, "image_id": image["id"]}
            annotation |= {"video_id": number, "track_id": number, "category_id": category}
            area = area if math.isfinite(area) else 0.0
            box = {"bbox": rows[frame], "area": area, "iscrowd": 0}
            parts["annotations"].append({**annotation, **box})


def _read_foreign(coco: CocoVideo, path: Path, base: Path) -> Described:
    images: dict[int, list[Picture]] = defaultdict(list)
    for image in coco.images:
        images[image.video_id].append(image)
    by_image: dict[int, list[Annotation]] = defaultdict(list)
    for annotation in coco.annotations:
        by_image[annotation.image_id].append(annotation)
    categories = {category.id: category.name for category in coco.categories}
    sequences: list[AnnotatedSequence] = []
    for video in coco.videos:
        pictures = sorted(images[video.id], key=_order)
        sequences += _sequences(video, pictures, by_image, categories, f"{path}: {video.name}")
    document = AnnotatedDataset(
        name=path.stem, version=coco.info.version, sequences=tuple(sequences)
    )
    document = check_dataset(document, str(path))
    prefix = _image_folder(base, document)
    frames = {s.name: stored_frames(base / prefix, s.frames) for s in document.sequences}
    remark = "fields beside boxes, tracks, categories, sizes and fps are not kept"
    words = f"COCO-video JSON {path.name}"
    return Described(document, frames, base, words, (f"{path.name}: {remark}",))


def _order(image: Picture) -> tuple[int, int]:
    return (image.id if image.frame_id is None else image.frame_id), image.id


def _sequences(
    video: Video,
    images: list[Picture],
    by_image: dict[int, list[Annotation]],
    categories: dict[int, str],
    where: str,
) -> Iterator[AnnotatedSequence]:
    """One sequence for each target of a video."""
    frames = _frames(images, where)
    name = PurePosixPath(video.name).name or f"video{video.id}"
    size = (video.width, video.height)
    if images and not all(size):
        size = images[0].width, images[0].height
    tracks: dict[int, list[Row]] = {}
    kinds: dict[int, str] = {}
    for index, image in enumerate(images):
        for annotation in by_image[image.id]:
            rows = tracks.setdefault(annotation.track, [_ABSENT] * len(images))
            if rows[index] != _ABSENT:
                msg = f"{where}: two boxes of track {annotation.track} in {image.file_name}"
                raise AnnotationInvalid(msg)
            rows[index] = annotation.bbox
            kinds[annotation.track] = categories.get(annotation.category_id, "")
    for track, boxes in tracks.items() or [(0, None)]:
        kind = kinds.get(track, "")
        yield AnnotatedSequence(
            name=name if len(tracks) < 2 else f"{name}_{track}",
            frames=frames,
            boxes=None if boxes is None else tuple(boxes),
            category="" if kind == _UNKNOWN else kind,
            resolution=(size[0], size[1]) if size[0] and size[1] else None,
            fps=video.fps or None,
        )


def _frames(images: list[Picture], where: str) -> FrameFiles:
    strange = next((i.file_name for i in images if not is_inner_path(i.file_name)), None)
    if strange is not None:
        msg = f"{where}: image {strange!r} leads out of the dataset's folder, or is no plain path"
        raise AnnotationInvalid(msg)
    paths = [PurePosixPath(image.file_name) for image in images]
    folders = {str(path.parent).removeprefix(".") for path in paths}
    if len(folders) != 1:
        msg = f"{where}: its images lie in {len(folders)} folders, expected one"
        raise AnnotationInvalid(msg)
    return frame_files(folders.pop(), tuple(path.name for path in paths))


def _image_folder(base: Path, document: AnnotatedDataset) -> str:
    """The folder below `base` from which file names count, often `data` or `images`."""
    first = document.sequences[0].frames.folder if document.sequences else ""
    candidates = ("", *_IMAGE_FOLDERS)
    return next((name for name in candidates if (base / name / first).is_dir()), "")
