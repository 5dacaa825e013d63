"""Every image of an input through every enhancer, resumable, failures kept apart."""

import logging
import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeAlias

from nat2024.backends import BackendWish, Precision
from nat2024.datasets.video_writing import VIDEO_ENDING, VideoFile, can_be_video
from nat2024.devices import check_device
from nat2024.engine.plan import (
    PluginSpec,
    options_at_default,
    plugin_record,
    plugin_specs,
    refuse_unused,
    with_backend,
)
from nat2024.enhancing.annotation import write_annotation
from nat2024.enhancing.feeding import Feed, enhance
from nat2024.enhancing.pictures import Picture, encode_picture
from nat2024.enhancing.reporting import (
    Enhanced,
    EnhancementReport,
    Failure,
    Observation,
    Observer,
)
from nat2024.enhancing.settings import EnhancementRecord, open_folder
from nat2024.enhancing.sources import ImageItem, Item, Source, VideoItem, find_source
from nat2024.errors import FrameUnreadable, NatBenchError, UsageError
from nat2024.files import remove_leftovers, write_atomic
from nat2024.interfaces import Enhancer
from nat2024.registry import create_enhancer
from nat2024.types import Image

log = logging.getLogger("nat2024")

Progress: TypeAlias = Callable[[int, str], Any]
"""Called with the images done since the last call, and what they belong to."""

MAPS_FOLDER = "maps"


@dataclass(slots=True)
class _Job:
    """One enhancer on its way through the input."""

    title: str
    enhancer: Enhancer
    folder: Path
    feed: Feed
    quality: int
    frames_only: bool
    observer: Observer | None
    progress: Progress
    told: list[str]
    written: int = 0
    before: int = 0
    failures: list[Failure] = field(default_factory=list)
    failed: int = 0
    torn: set[str] = field(default_factory=set)

    def enhance(self, item: Item, index: int, picture: Picture) -> Image:
        if picture.reduced and not self.told:
            log.warning("%s: 16 bits a channel, reduced to 8", item.title(index))
            self.told.append(item.title(index))
        try:
            after = enhance(self.enhancer, picture.image, self.feed)
        except NatBenchError:
            raise
        except (Exception, SystemExit) as error:  # a plugin may fail in any way
            msg = f"{type(error).__name__}: {error}"
            raise NatBenchError(msg) from error
        if self.observer:
            name = item.title(index)
            self.observer(
                Observation(self.title, name, self.enhancer, picture.image, after, self.feed)
            )
        return after

    def fail(self, item: Item, where: str, error: Exception, count: int) -> None:
        self.failures.append(Failure(self.title, where, str(error)))
        self.failed += count
        self.torn.add(item.sequence)
        log.error("%s, %s: %s", self.title, where, error)


def _no_progress(_images: int, _what: str) -> None:
    pass


def enhance_images(
    source: str | os.PathLike[str] | Source,
    enhancers: Iterable[str],
    out: str | os.PathLike[str],
    *,
    options: Mapping[str, Mapping[str, Any]] | None = None,
    weights: Mapping[str, str] | None = None,
    device: str = "cpu",
    backend: BackendWish = "torch",
    precision: Precision = "float32",
    feed: Feed = "image",
    quality: int = 95,
    frames_only: bool = False,
    observer: Observer | None = None,
    progress: Progress = _no_progress,
) -> EnhancementReport:
    """Enhance an image, a folder of images, a video or a dataset with each of the enhancers.

    `OUT/ENHANCER[@LABEL]/` gets the images under their own names, a video as WebM, and a dataset
    with its annotation, so that it is a dataset again; `OUT/ENHANCER[@LABEL].json` says what made
    them. Files are whole or absent, and those that are there are not made again. An image that
    fails costs only itself.

    Args:
        source: what `find_source` takes or gives.
        enhancers: `NAME` or `NAME@LABEL` each.
        out: folder that is written to.
        options: by `NAME[@LABEL]`, then by option.
        weights: path of a checkpoint by `NAME[@LABEL]`.
        device: where networks run.
        backend: what runs them, for all that have this option.
        precision: what the backend computes in, likewise.
        feed: "image" feeds colours as the authors' stand-alone tests do, "tracker" BGR as a
            tracker feeds frames.
        quality: of JPEG, 1..100.
        frames_only: write a video's frames as PNG, without the loss of a video.
        observer: told of each image before and after; images that are there already are then
            enhanced again, and not written.
        progress: called with images done since the last call and what they belong to.

    Raises:
        UsageError: no enhancer, one is named twice, or `out` and the input lie in each other.
        UnknownPlugin, InvalidOption, WeightsMissing, WeightsMismatch: an enhancer cannot be had.
        DatasetNotFound: as `find_source`.
        ResultConflict: a folder was made with other settings.
        Unwritable: the file system refuses.
    """
    found = source if isinstance(source, Source) else find_source(source)
    options, weights, out = options or {}, weights or {}, Path(out)
    specs = _specs(enhancers, options, weights, backend, precision)
    _check(found, out, specs, quality)
    made = _create(specs, device)
    jobs = []
    told: list[str] = []  # shared, so that it is said once
    for spec, enhancer in zip(specs, made, strict=True):
        record = _record(found, spec, enhancer, device, feed, quality, frames_only)
        open_folder(out / spec.title, record, options_at_default(spec, enhancer))
        jobs.append(
            _Job(
                spec.title,
                enhancer,
                out / spec.title,
                feed,
                quality,
                frames_only,
                observer,
                progress,
                told,
            )
        )
    for job in jobs:
        _run(job, found)
    return EnhancementReport(
        str(found.path),
        found.kind,
        count_images(found),
        tuple(Enhanced(j.title, str(j.folder), j.written, j.before, j.failed) for j in jobs),
        tuple(failure for job in jobs for failure in job.failures),
    )


def count_images(source: Source) -> int:
    """Number of images and of frames of videos; a video that cannot be opened counts as one."""
    return sum(_length(item) for item in source.items)


def _length(item: Item) -> int:
    try:
        return len(item)
    except FrameUnreadable:
        return 1


def create_enhancers(
    enhancers: Iterable[str],
    *,
    options: Mapping[str, Mapping[str, Any]] | None = None,
    weights: Mapping[str, str] | None = None,
    device: str = "cpu",
    backend: BackendWish = "torch",
    precision: Precision = "float32",
) -> dict[str, Enhancer]:
    """The enhancers by `NAME[@LABEL]`; arguments and errors as of `enhance_images`."""
    specs = _specs(enhancers, options or {}, weights or {}, backend, precision)
    titles = (spec.title for spec in specs)
    return dict(zip(titles, _create(specs, device), strict=True))


def _specs(
    enhancers: Iterable[str],
    options: Mapping[str, Mapping[str, Any]],
    weights: Mapping[str, str],
    backend: BackendWish,
    precision: Precision,
) -> list[PluginSpec]:
    specs = plugin_specs("enhancer", enhancers, options, weights)
    refuse_unused(specs, options, weights)
    if not specs:
        msg = "name at least one enhancer"
        raise UsageError(msg)
    return [with_backend(spec, "enhancer", backend, precision) for spec in specs]


def _create(specs: Iterable[PluginSpec], device: str) -> list[Enhancer]:
    check_device(device)
    return [create_enhancer(s.name, weights=s.weights, device=device, **s.options) for s in specs]


def _check(source: Source, out: Path, specs: list[PluginSpec], quality: int) -> None:
    if not 1 <= quality <= 100:
        msg = f"quality must be in 1..100, not {quality}"
        raise UsageError(msg)
    given, place = source.path.resolve(), out.resolve()
    if os.path.lexists(out) and not out.is_dir():
        msg = f"--out {out} is no folder; choose another one"
        raise UsageError(msg)
    if place.is_relative_to(given):
        msg = f"--out {out} lies in the input {source.path}; choose a folder outside of it"
        raise UsageError(msg)
    for name in (*(spec.title for spec in specs), MAPS_FOLDER):
        folder = (out / name).resolve()
        if given.is_relative_to(folder):
            msg = f"the input {source.path} lies in {out / name}, which is to be written"
            raise UsageError(msg)
        if not folder.is_relative_to(place):
            msg = f"{out / name} is a link out of {out}; choose another --out folder"
            raise UsageError(msg)
    if any(spec.title == MAPS_FOLDER for spec in specs):
        msg = f"an enhancer called {MAPS_FOLDER} needs a label ({MAPS_FOLDER}@LABEL)"
        raise UsageError(msg)


def _record(
    source: Source,
    spec: PluginSpec,
    enhancer: Enhancer,
    device: str,
    feed: Feed,
    quality: int,
    frames_only: bool,
) -> EnhancementRecord:
    frames = ""
    for item in source.items:
        if isinstance(item, VideoItem):
            frames = f"every {item.every}, " + (f"at most {item.limit}" if item.limit else "all")
            frames += ", as frames" if frames_only else ""
    return EnhancementRecord(
        source=str(source.path.resolve()),
        kind=source.kind,
        enhancer=plugin_record(spec, enhancer),
        feed=feed,
        device=device.partition(":")[0],
        quality=quality,
        frames=frames,
    )


def _run(job: _Job, source: Source) -> None:
    for parent in {(job.folder / item.target).parent for item in source.items}:
        _refuse_link(parent, job.folder)
        if parent.is_dir():
            remove_leftovers(parent)
    for item in source.items:
        if isinstance(item, ImageItem):
            _image(job, item)
        else:
            _video(job, item)
    if source.place is not None:
        names = {found.name for found in source.place.layout.sequences}
        whole = sorted(names - job.torn)
        write_annotation(source.place, job.folder, whole, selected=source.selected)


def _refuse_link(folder: Path, top: Path) -> None:
    """Nothing outside is written, wherever a link in the output leads."""
    if not folder.resolve().is_relative_to(top.resolve()):
        msg = f"{folder} is a link out of {top}; choose another --out folder"
        raise UsageError(msg)


def _image(job: _Job, item: ImageItem) -> None:
    target = job.folder / item.target
    finished = target.is_file()
    try:
        if not finished or job.observer:
            picture = item.read()
            after = job.enhance(item, 0, picture)
            if not finished:
                raw = encode_picture(after, picture, target.suffix, job.quality)
                write_atomic(target, raw)
    except _ONE_IMAGE as error:
        job.fail(item, item.title(), error, 1)
    else:
        job.written += not finished
        job.before += finished
    job.progress(1, job.title)


_ONE_IMAGE = (NatBenchError,)
"""Errors that cost one image."""


def _video(job: _Job, item: VideoItem) -> None:
    done, count = 0, _length(item)
    where = str(item.target)
    try:
        finished = find_video(job.folder, item) is not None
        if not finished or job.observer:
            for index, _ in _frames(job, item, write=not finished):
                where = item.title(index)
                done += 1
                job.progress(1, job.title)
    except _ONE_IMAGE as error:
        job.fail(item, where, error, count)
    else:
        job.written += 0 if finished else count
        job.before += count if finished else 0
    job.progress(count - done, job.title)


def _frames(job: _Job, item: VideoItem, *, write: bool) -> Iterator[tuple[int, Image]]:
    """Enhance the frames of a video and write them as they come."""
    images = ((index, job.enhance(item, index, item.read(index))) for index in range(len(item)))
    if not write:
        yield from images
    elif job.frames_only or not can_be_video(*item.frames.frame_size):
        yield from _as_files(job, item, images)
    else:
        path = (job.folder / item.target).with_suffix(VIDEO_ENDING)
        with VideoFile(path, item.frames.frame_size, item.rate) as video:
            for index, image in images:
                video.write(image)
                yield index, image


def _as_files(
    job: _Job, item: VideoItem, images: Iterable[tuple[int, Image]]
) -> Iterator[tuple[int, Image]]:
    if not job.frames_only:
        width, height = item.frames.frame_size
        log.warning("%s: %dx%d has an odd side, written as frames", item.target, width, height)
    folder = frames_folder(job.folder, item)
    for index, image in images:
        raw = encode_picture(image, Picture(image), ".png", job.quality)
        write_atomic(folder / frame_name(index), raw)
        yield index, image


def frames_folder(folder: Path, item: VideoItem) -> Path:
    """Where the frames of a video go that is not written as a video."""
    return folder / item.target.with_suffix("")


def frame_name(index: int) -> str:
    """File name of a frame, counted from 0, in such a folder."""
    return f"{index + 1:06d}.png"


def find_video(folder: Path, item: VideoItem) -> Path | None:
    """The enhanced video, or the folder of all its frames; None where it is not whole."""
    path = (folder / item.target).with_suffix(VIDEO_ENDING)
    if path.is_file():
        return path
    frames = frames_folder(folder, item)
    last = frames / frame_name(len(item) - 1)
    return frames if last.is_file() else None
