"""A folder of night images that an enhancer can be trained on, made of photographs and of code.

All follows from the photographs and the seeds here: the same folder gives the same images.
"""

import hashlib
import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from nat2024.errors import FrameUnreadable, UsageError
from nat2024.files import remove_leftovers, write_atomic
from nat2024.night.photographs import night_photograph, night_views
from nat2024.night.sample import SEEDS
from nat2024.night.sequence import KINDS, NightSequence, NightSettings
from nat2024.types import Image

RECORD = "images.json"
_SUFFIXES = (".jpg", ".jpeg", ".png")
_SIZE = (640, 360)


@dataclass(frozen=True, slots=True)
class TrainingImages:
    """What is made.

    Attributes:
        rounds: scenes made of each photograph.
        rendered: scenes made of code alone.
        held_out: of how many photographs one is held out, for checking.
        seed: of the first scene of a photograph; the others follow.
        rendered_seed: of the first scene made of code.
    """

    rounds: int = 2
    rendered: int = 40
    held_out: int = 29
    seed: int = 100_000
    rendered_seed: int = 300_000

    def seeds(self, photographs: int) -> tuple[range, range]:
        """The seeds of scenes of so many photographs, and of those made of code.

        Raises:
            UsageError: one of them is kept for the sample `night_mini`.
        """
        used = (
            range(self.seed, self.seed + self.rounds * photographs),
            range(self.rendered_seed, self.rendered_seed + self.rendered),
        )
        for some in used:
            if some and some[0] <= SEEDS[-1] and some[-1] >= SEEDS[0]:
                msg = f"seeds {some[0]} to {some[-1]}: {SEEDS[0]} to {SEEDS[-1]} are kept for "
                msg += "the sample night_mini; choose others"
                raise UsageError(msg)
        return used


def make_training_images(
    photographs: Path,
    out: Path,
    wanted: TrainingImages | None = None,
    on_progress: Callable[[int, int], object] = lambda _done, _all: None,
) -> dict[str, Any]:
    """Make the images, 256x256 PNG, in `out/train` and `out/held_out`.

    What is there already is not made again, so that an interrupted call goes on.

    Args:
        photographs: a folder of JPEG or PNG files, in daylight.
        out: gets the images and the record `images.json`.
        wanted: how many.
        on_progress: called with scenes done and all scenes.

    Returns:
        The record: `settings`, `photographs` (names with sha256), `train` and `held_out` (names).

    Raises:
        UsageError: the folder has no photographs, or `out` holds images of others.
        FrameUnreadable: a photograph is none.
        Unwritable: the file system refuses.
    """
    wanted = wanted or TrainingImages()
    found = _photographs_in(photographs)
    jobs = list(_jobs(found, wanted))
    record: dict[str, Any] = {
        "settings": asdict(wanted),
        "photographs": {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in found},
    }
    _check_record(out / RECORD, record)
    write_atomic(out / RECORD, _as_text(record))
    for group in ("train", "held_out"):
        remove_leftovers(out / group)
    names: dict[str, list[str]] = {"train": [], "held_out": []}
    for done, job in enumerate(jobs, 1):
        names[job.group] += job.make(out / job.group)
        on_progress(done, len(jobs))
    record |= names
    write_atomic(out / RECORD, _as_text(record))
    return record


@dataclass(frozen=True, slots=True)
class _Job:
    """One scene; `photograph` is None where it is made of code."""

    photograph: Path | None
    seed: int
    group: str

    def make(self, folder: Path) -> list[str]:
        """Write its views; gives their names."""
        stem = self.photograph.stem if self.photograph else "rendered"
        done = folder / f".{stem}_{self.seed}.done"
        if done.is_file():
            return done.read_text(encoding="utf-8").split()
        names = []
        for number, view in enumerate(night_views(self._scene(), self.seed)):
            name = f"{stem}_{self.seed}_{number}.png"
            write_atomic(folder / name, _as_png(view))
            names.append(name)
        write_atomic(done, "\n".join(names))
        return names

    def _scene(self) -> Image:
        if self.photograph is not None:
            return night_photograph(_read(self.photograph), self.seed)
        kind = KINDS[self.seed % len(KINDS)]
        settings = NightSettings(kind, frames=2, size=_SIZE, seed=self.seed)
        return NightSequence(settings).frame(0).image


def _jobs(photographs: Sequence[Path], wanted: TrainingImages) -> Iterator[_Job]:
    seeds, rendered = wanted.seeds(len(photographs))
    for number, seed in enumerate(seeds):
        place = number % len(photographs)
        group = "held_out" if place % wanted.held_out == 0 else "train"
        yield _Job(photographs[place], seed, group)
    for seed in rendered:
        yield _Job(None, seed, "train")


def _photographs_in(folder: Path) -> list[Path]:
    paths = folder.iterdir() if folder.is_dir() else ()
    found = sorted(path for path in paths if path.suffix.lower() in _SUFFIXES)
    if not found:
        msg = f"{folder}: no photographs ({', '.join(_SUFFIXES)}) in it"
        raise UsageError(msg)
    return found


def _check_record(path: Path, record: dict[str, Any]) -> None:
    if not path.is_file():
        return
    try:
        before = json.loads(path.read_bytes())
    except (ValueError, RecursionError):  # no record of ours, so of other settings
        before = None
    if not isinstance(before, dict) or any(before.get(k) != v for k, v in record.items()):
        msg = f"{path.parent}: holds images of other photographs or settings; name another folder"
        raise UsageError(msg)


def _as_text(record: dict[str, Any]) -> str:
    return json.dumps(record, indent=1) + "\n"


def _read(path: Path) -> Image:
    import cv2

    image = cv2.imread(str(path), cv2.IMREAD_COLOR)
    if image is None:
        msg = f"{path}: no readable image"
        raise FrameUnreadable(msg)
    return np.asarray(image, dtype=np.uint8)


def _as_png(image: Image) -> bytes:
    import cv2

    _, coded = cv2.imencode(".png", image)
    return bytes(coded)
