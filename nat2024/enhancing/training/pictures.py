"""Pictures for training: found, brought to size, with targets that are made once and kept."""

import hashlib
import logging
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from nat2024.enhancing.sources import ImageItem, Item, Source, VideoItem, find_source
from nat2024.enhancing.training.settings import PictureSettings
from nat2024.errors import DatasetNotFound, FrameUnreadable, Unwritable
from nat2024.files import remove_leftovers, write_atomic
from nat2024.types import Image

if TYPE_CHECKING:
    import torch

_log = logging.getLogger("nat2024")

_LIGHT_SAMPLE = 50
_IN_MEMORY = 2 << 30
CACHE = ".nat-bench"

Targets: TypeAlias = "Callable[[torch.Tensor], Mapping[str, torch.Tensor]]"
Progress: TypeAlias = Callable[[int, str], Any]


@dataclass(frozen=True, slots=True)
class Shot:
    """One picture of an input: a file, or a frame of a video."""

    item: Item
    index: int = 0

    @property
    def title(self) -> str:
        """What to call it."""
        return self.item.title(self.index)

    @property
    def key(self) -> str:
        """Tells its content: another name, size or time of change gives another key."""
        path = self.item.source if isinstance(self.item, ImageItem) else self.item.frames.path
        try:
            facts = path.stat()
            state = f"{facts.st_size} {facts.st_mtime_ns}"
        except OSError:  # inside an archive
            state = ""
        return hashlib.sha256(f"{self.title}\0{state}".encode()).hexdigest()[:20]

    def read(self) -> Image:
        """The picture, RGB; `FrameUnreadable` where it is none."""
        return np.ascontiguousarray(self.item.read(self.index).image[..., ::-1])


def find_shots(data: str | Path, root: str | Path | None, every: int) -> tuple[Source, list[Shot]]:
    """The pictures of a folder, video or dataset, in order.

    Raises:
        DatasetNotFound: nothing is there, or there is no picture in it.
    """
    source = find_source(data, root)
    shots: list[Shot] = []
    counted: dict[str, int] = {}
    step = every or (1 if source.kind == "images" else _LIGHT_SAMPLE)
    for item in source.items:
        if isinstance(item, VideoItem):
            shots += [Shot(item, index) for index in range(0, len(item), step)]
            continue
        number = counted.get(item.sequence, 0)
        counted[item.sequence] = number + 1
        if number % step == 0:
            shots.append(Shot(item))
    if not shots:
        msg = f"{data}: no picture in it"
        raise DatasetNotFound(msg)
    if step > 1:
        what = "one of every %d frames of the %s: %d pictures (setting every=1 takes all)"
        _log.info(what, step, source.kind, len(shots))
    return source, shots


@dataclass(slots=True)
class PictureStore:
    """Pictures at training size, each with its targets, all uint8 (1 + targets, H, W, 3) RGB.

    Attributes:
        shots: the pictures.
        settings: their size.
        targets: makes the targets of a batch in 0..1, None where there are none.
        folder: where pictures with targets are kept, one file each, None to make them anew.
        names: of the targets.
    """

    shots: Sequence[Shot]
    settings: PictureSettings
    targets: "Targets | None" = None
    folder: Path | None = None
    names: tuple[str, ...] = ()
    _kept: dict[int, Image] = field(default_factory=dict)
    _bytes: int = 0

    def __post_init__(self) -> None:
        if self.targets is not None:
            import torch

            with torch.no_grad():  # a small picture tells what there will be
                self.names = tuple(self.targets(torch.full((1, 3, 32, 32), 0.5)))

    def prepare(self, workers: int, progress: Progress) -> None:
        """Read all pictures once and make what is missing; goes on where it was stopped.

        Pictures that cannot be read are left out, which is said.

        Raises:
            DatasetNotFound: none can be read.
            Unwritable: the file system refuses; what was made stays.
        """
        if self.folder is not None:
            remove_leftovers(self.folder)
        readable = []
        numbers = range(len(self.shots))
        with ThreadPoolExecutor(max(workers, 1)) as pool:
            for number, fine in zip(numbers, pool.map(self._can_load, numbers), strict=True):
                if fine:
                    readable.append(number)
                progress(1, "pictures")
        if not readable:
            first = self.shots[0].title
            msg = f"none of {len(self.shots)} pictures can be read, the first is {first}"
            raise DatasetNotFound(msg)
        missing = len(self.shots) - len(readable)
        if missing:
            _log.warning("%d of %d pictures cannot be read: left out", missing, len(self.shots))
            kept = {new: self._kept[old] for new, old in enumerate(readable) if old in self._kept}
            self.shots, self._kept = [self.shots[number] for number in readable], kept

    def _can_load(self, number: int) -> bool:
        try:
            self.load(number)
        except FrameUnreadable as error:
            _log.warning("%s", error)
            return False
        return True

    def load(self, number: int) -> Image:
        """Picture and targets; not to be written to."""
        kept = self._kept.get(number)
        if kept is not None:
            return kept
        stack = self._read(self.shots[number])
        if self._bytes + stack.nbytes <= _IN_MEMORY:
            self._bytes += stack.nbytes
            self._kept[number] = stack
        return stack

    def _read(self, shot: Shot) -> Image:
        path = None if self.folder is None else self.folder / f"{shot.key}.png"
        if path is not None and path.is_file():
            stack = _decode(path, len(self.names))
            if stack is not None:
                return stack
        picture = fit_picture(shot.read(), self.settings)
        stack = picture[None] if self.targets is None else self._with_targets(picture)
        if path is not None:
            self._keep(path, stack)
        return stack

    def _keep(self, path: Path, stack: Image) -> None:
        try:
            write_atomic(path, _encode(stack))
        except Unwritable as error:
            msg = f"{error}; --cache names another folder for pictures with their labels"
            raise Unwritable(msg) from None

    def _with_targets(self, picture: Image) -> Image:
        import torch

        assert self.targets is not None
        batch = torch.from_numpy(picture.transpose(2, 0, 1)[None].astype(np.float32) / 255)
        with torch.no_grad():
            made = self.targets(batch)
        parts = [picture]
        for target in made.values():
            pixels = (target[0].clamp(0, 1) * 255 + 0.5).floor().to(torch.uint8)
            parts.append(pixels.permute(1, 2, 0).numpy())
        return np.stack(parts)


def fit_picture(picture: Image, settings: PictureSettings) -> Image:
    """Bring a picture to training size: a square, or at least as large as one for "crop"."""
    import cv2

    size = settings.size
    height, width = picture.shape[:2]
    wanted = (size, size)
    if settings.fit == "crop":
        scale = max(size / min(height, width), 1.0)
        wanted = (max(round(width * scale), size), max(round(height * scale), size))
    if (width, height) == wanted:
        return picture
    shrinks = wanted[0] <= width and wanted[1] <= height
    return cv2.resize(  # type: ignore[return-value]
        picture, wanted, interpolation=cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR
    )


def _encode(stack: Image) -> bytes:
    import cv2

    tall = np.ascontiguousarray(stack.reshape(-1, *stack.shape[2:])[..., ::-1])
    return cv2.imencode(".png", tall)[1].tobytes()


def _decode(path: Path, targets: int) -> Image | None:
    """None where the file is no whole stack, so that it is made anew."""
    import cv2

    raw = path.read_bytes()
    if raw[-8:-4] != b"IEND":  # OpenCV fills up what is cut off
        return None
    tall = cv2.imdecode(np.frombuffer(raw, np.uint8), cv2.IMREAD_COLOR)
    count = 1 + targets
    if tall is None or tall.shape[0] % count:
        return None
    stack = tall[..., ::-1].reshape(count, -1, *tall.shape[1:])
    return np.ascontiguousarray(stack)
