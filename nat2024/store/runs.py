"""Run folders, and what evaluation needs of a run from anywhere."""

import contextlib
import os
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

import msgspec
import numpy as np

from nat2024.boxes import parse_boxes, parse_rows, read_boxes, read_text, write_boxes
from nat2024.errors import ResultConflict, Unwritable
from nat2024.files import remove_leftovers, write_atomic
from nat2024.importing import split_name
from nat2024.store.manifests import Manifest, StageTimes, split_run_name
from nat2024.types import Boxes, Floats

STAGES = ("read", "enhance", "track")


class Run(Protocol):
    """One run, as nat-bench or another toolkit stored it: `RunFolder` and `ForeignRun` are such."""

    @property
    def name(self) -> str:
        """The run's name, unique among those beside it."""
        ...

    @property
    def path(self) -> Path:
        """Its folder or archive; it may lead through an archive, so read nothing from it."""
        ...

    @property
    def tracker(self) -> str:
        """Name of the tracker, with its label."""
        ...

    @property
    def enhancer(self) -> str:
        """Name of the enhancer, with its label; "none" for the plain tracker."""
        ...

    @property
    def dataset(self) -> str:
        """Name of the dataset, where a run of another toolkit is stored with it."""
        ...

    def finished(self) -> list[str]:
        """Names of all sequences that have a result, sorted."""
        ...

    def has(self, sequence: str, /) -> bool:
        """Whether the sequence has a result."""
        ...

    def box_file(self, sequence: str, /) -> Path:
        """Where the boxes of a sequence come from, for messages."""
        ...

    def boxes(self, sequence: str, /) -> Boxes:
        """Boxes of a sequence (of its first repeat), float64 (n, 4)."""
        ...

    def repeats(self, sequence: str, /) -> list[Boxes]:
        """Boxes of all repeats of a sequence, at least one."""
        ...

    @property
    def layout(self) -> str:
        """Name of the layout: with equal ones `parse` makes equal boxes of equal bytes."""
        ...

    def contents(self, sequence: str, /) -> list[tuple[Path, bytes]]:
        """Files of all repeats of a sequence and their bytes."""
        ...

    @property
    def parse(self) -> Callable[[bytes, Path], Boxes]:
        """Makes boxes of the bytes of `contents`; the path is named in errors."""
        ...

    def frame_seconds(self, sequence: str, /) -> Floats | None:
        """Seconds of enhancing and tracking of each frame (n,), None where nothing tells."""
        ...

    def manifest(self) -> Manifest | None:
        """What made the run, None for foreign results."""
        ...


@dataclass(frozen=True, slots=True)
class Track:
    """What a tracker did on one sequence.

    Attributes:
        boxes: float64 (n, 4).
        seconds: float64 (n, 3) of `STAGES`.
        skipped: 0-based numbers of the frames that could not be read; their boxes are repeated.
        other_backends: by plugin (`NAME[@LABEL]`), the backends that ran it, where that is not just
            the one that its options name.
    """

    boxes: Boxes
    seconds: Floats
    skipped: tuple[int, ...] = ()
    other_backends: Mapping[str, tuple[str, ...]] = field(default_factory=dict)


class RunFolder:
    """One `RESULTS/DATASET/RUN` folder."""

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)

    @property
    def name(self) -> str:
        """The run's name."""
        return self.path.name

    @property
    def tracker(self) -> str:
        """Name of the tracker, with its label."""
        return self._names()[0]

    @property
    def enhancer(self) -> str:
        """Name of the enhancer, with its label; "none" for the plain tracker."""
        return self._names()[1]

    @property
    def dataset(self) -> str:
        """Nothing: the folder above the run is the dataset's."""
        return ""

    def _names(self) -> tuple[str, str]:
        manifest = self.manifest()
        if manifest is None:  # nothing tells who wrote it, so its name may be of any form
            return split_name(self.name)
        if manifest.imported is None:
            return split_run_name(self.name)
        enhancer = manifest.enhancer.title if manifest.enhancer else "none"
        return manifest.tracker.title, enhancer

    def box_file(self, sequence: str) -> Path:
        """Where the boxes of a sequence are kept."""
        return self.path / f"{sequence}.txt"

    def time_file(self, sequence: str) -> Path:
        """Where the times of a sequence are kept."""
        return self.path / "time" / f"{sequence}.csv"

    def skipped_file(self, sequence: str) -> Path:
        """Where the numbers of skipped frames of a sequence are kept, if there are any."""
        return self.path / "skipped" / f"{sequence}.csv"

    def backends_file(self, sequence: str) -> Path:
        """Where backends are kept that took over on a sequence, if there are any."""
        return self.path / "backends" / f"{sequence}.json"

    def has(self, sequence: str) -> bool:
        """Whether the sequence is finished."""
        return self.box_file(sequence).is_file()

    def finished(self) -> list[str]:
        """Names of all finished sequences, sorted."""
        return sorted(p.stem for p in self.path.glob("*.txt") if not p.name.startswith("."))

    def boxes(self, sequence: str) -> Boxes:
        """Stored boxes, float64 (n, 4); every separator that foreign writers use is read."""
        return read_boxes(self.box_file(sequence))

    def repeats(self, sequence: str) -> list[Boxes]:
        """Boxes of all repeats: the stored ones alone."""
        return [self.boxes(sequence)]

    @property
    def layout(self) -> str:
        """The name of nat-bench's own layout."""
        return "nat-bench"

    def contents(self, sequence: str) -> list[tuple[Path, bytes]]:
        """The file of a sequence and its bytes."""
        path = self.box_file(sequence)
        return [(path, read_text(path))]

    def parse(self, raw: bytes, path: Path) -> Boxes:
        """Boxes of such bytes; the path is named in errors."""
        return parse_boxes(raw, source=str(path))

    def frame_seconds(self, sequence: str) -> Floats | None:
        """Seconds of enhancing and tracking of each frame (n,); None where none are stored."""
        if not self.time_file(sequence).is_file():
            return None
        seconds: Floats = self.seconds(sequence)[:, 1:].sum(axis=1)
        return seconds

    def seconds(self, sequence: str) -> Floats:
        """Stored seconds of `STAGES`, float64 (n, 3)."""
        path = self.time_file(sequence)
        _, _, body = path.read_bytes().partition(b"\n")
        return parse_rows(body, str(path), (len(STAGES),))

    def write(self, sequence: str, track: Track) -> None:
        """Store one finished sequence; the boxes last, since they say that it is finished."""
        skipped = self.skipped_file(sequence)
        if track.skipped:
            write_atomic(skipped, "".join(f"{number}\n" for number in track.skipped))
        else:
            skipped.unlink(missing_ok=True)
        backends = self.backends_file(sequence)
        if track.other_backends:
            write_atomic(backends, msgspec.json.encode(dict(track.other_backends)) + b"\n")
        else:
            backends.unlink(missing_ok=True)
        rows = (",".join(f"{value:.6f}" for value in row) for row in track.seconds.tolist())
        write_atomic(self.time_file(sequence), "\n".join([",".join(STAGES), *rows, ""]))
        write_boxes(self.box_file(sequence), track.boxes)

    def skipped_frames(self) -> dict[str, list[int]]:
        """Numbers of skipped frames of all finished sequences that have some.

        Raises:
            ResultConflict: a file of them has anything but whole numbers in it.
        """
        found = {}
        for path in sorted(self.path.glob("skipped/*.csv")):
            if self.has(path.stem):
                found[path.stem] = _read_numbers(path)
        return found

    def other_backends(self) -> dict[str, dict[str, list[str]]]:
        """Backends that took over, by finished sequence and plugin; see `Track`.

        Raises:
            ResultConflict: a file of them holds anything else.
        """
        found = {}
        for path in sorted(self.path.glob("backends/*.json")):
            if self.has(path.stem):
                try:
                    found[path.stem] = msgspec.json.decode(
                        path.read_bytes(), type=dict[str, list[str]]
                    )
                except (ValueError, RecursionError):
                    msg = f"{path}: expected lists of backends by plugin; move the file away"
                    raise ResultConflict(msg) from None
        return found

    @contextlib.contextmanager
    def alone(self) -> Iterator[None]:
        """Let no other process that asks for the same change the manifest meanwhile.

        The lock is the operating system's, on the folder itself, and ends with the process; file
        systems without such locks have none.

        Raises:
            Unwritable: the folder cannot be made; says why.
        """
        try:
            self.path.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            msg = f"{self.path}: cannot be written ({error.strerror or error})"
            raise Unwritable(msg) from None
        with contextlib.ExitStack() as stack:
            with contextlib.suppress(ImportError, OSError):
                import fcntl

                folder = os.open(self.path, os.O_RDONLY)
                stack.callback(os.close, folder)
                fcntl.flock(folder, fcntl.LOCK_EX)
            yield

    def clean(self) -> None:
        """Remove what killed processes have left half written."""
        for folder in (self.path, *(self.path / name for name in ("time", "skipped", "backends"))):
            remove_leftovers(folder)

    def manifest(self) -> Manifest | None:
        """The manifest, None where the folder has none (foreign results).

        Raises:
            ResultConflict: it is there but cannot be read.
        """
        path = self.path / "run.json"
        try:
            return msgspec.json.decode(path.read_bytes(), type=Manifest)
        except FileNotFoundError:
            return None
        except OSError as error:
            msg = f"{path}: cannot be read ({error.strerror or error})"
            raise ResultConflict(msg) from None
        except (ValueError, RecursionError) as error:  # no UTF-8 and endless nesting too
            msg = f"{path}: not a manifest of this version ({error}); move the folder away"
            raise ResultConflict(msg) from None

    def write_manifest(self, manifest: Manifest) -> None:
        """Store the manifest."""
        raw = msgspec.json.format(msgspec.json.encode(manifest), indent=2)
        write_atomic(self.path / "run.json", raw + b"\n")

    def stage_times(self) -> StageTimes | None:
        """Mean times over all finished sequences, None where none are stored.

        Frames that were skipped cost no enhancing or tracking and do not count.
        """
        skipped = self.skipped_frames()
        stored = {s: self.seconds(s) for s in self.finished() if self.time_file(s).is_file()}
        tables = [
            table[~np.isin(np.arange(len(table)), skipped.get(s, []))]
            for s, table in stored.items()
        ]
        tables = [table for table in tables if len(table)]
        if not tables:
            return None
        steady = np.concatenate([table[1:] for table in tables])
        first = np.array([table[0].sum() for table in tables])
        read, enhance, track = steady.mean(axis=0).tolist() if len(steady) else (0.0, 0.0, 0.0)
        busy = enhance + track
        return StageTimes(
            frames=sum(len(table) for table in tables),
            read=round(read, 6),
            enhance=round(enhance, 6),
            track=round(track, 6),
            first_frame=round(float(first.mean()), 6),
            frames_per_second=round(1 / busy, 3) if busy else 0.0,
            end_to_end_frames_per_second=round(1 / (busy + read), 3) if busy + read else 0.0,
        )


def _read_numbers(path: Path) -> list[int]:
    try:
        return [int(line) for line in path.read_bytes().decode("ascii").split()]
    except ValueError:
        msg = f"{path}: expected one frame number a line; move the file away"
        raise ResultConflict(msg) from None
