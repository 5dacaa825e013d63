"""Results on disk: text is the truth, everything else can be made again.

```
RESULTS/DATASET/RUN/SEQUENCE.txt        x,y,w,h a line, one line a frame
RESULTS/DATASET/RUN/time/SEQUENCE.csv   read,enhance,track seconds a frame
RESULTS/DATASET/RUN/skipped/SEQUENCE.csv  numbers of the frames that were skipped, if any
RESULTS/DATASET/RUN/run.json            manifest
```

RUN is `TRACKER[@LABEL][+ENHANCER[@LABEL]]`. A file that exists is whole; a run folder belongs to
one set of options, weights and scope.
"""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, TypeAlias

import msgspec
import numpy as np

from nat2024.boxes import parse_rows, read_boxes, write_boxes
from nat2024.errors import DatasetNotFound, ResultConflict
from nat2024.files import remove_leftovers, write_atomic
from nat2024.types import Boxes, Floats

OnBadFrame: TypeAlias = Literal["error", "skip"]
"""What to do with a frame that cannot be read."""

FORMAT = 1
STAGES = ("read", "enhance", "track")
_PLUGIN = r"[a-z0-9][a-z0-9_]*(?:@[A-Za-z0-9._-]+)?"
_RUN_NAME = re.compile(rf"(?P<tracker>{_PLUGIN})(?:\+(?P<enhancer>{_PLUGIN}))?")


class WeightsRecord(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Weights as a manifest keeps them; `path` is empty for fresh initial weights."""

    origin: str
    path: str = ""
    sha256: str = ""
    known_as: str = ""


class PluginRecord(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A tracker or enhancer as it ran: its full resolved options and its weights."""

    name: str
    label: str = ""
    options: dict[str, Any] = {}
    weights: WeightsRecord | None = None
    repeatable: bool = True

    @property
    def title(self) -> str:
        """`NAME` or `NAME@LABEL`."""
        return f"{self.name}@{self.label}" if self.label else self.name

    @property
    def shown(self) -> str:
        """`title` as tables show it: with the variant, where its weights come with a package.

        Such weights are not the authors', so `siamrpnpp (compact)` must not pass for `siamrpnpp`.
        """
        variant = self.options.get("variant")
        is_bundled = self.weights is not None and self.weights.origin == "bundled"
        return f"{self.title} ({variant})" if is_bundled and variant else self.title


class DatasetRecord(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Which dataset was run: its name, and how it was loaded (as in `types.Origin`)."""

    name: str
    source: str = ""
    root: str = ""
    lenient: bool = False
    rule: str | None = None


class Session(msgspec.Struct, forbid_unknown_fields=True):
    """One call of the engine that worked on a run."""

    started: str
    finished: str = ""
    workers: int = 1
    read_ahead: int = 0
    versions: dict[str, str] = {}
    machine: dict[str, str] = {}


class StageTimes(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Mean seconds a frame of each stage; the first frame of each sequence is kept apart."""

    frames: int
    read: float
    enhance: float
    track: float
    first_frame: float
    frames_per_second: float
    end_to_end_frames_per_second: float


class Manifest(msgspec.Struct, forbid_unknown_fields=True, kw_only=True):
    """What made a run folder.

    Attributes:
        dataset: what was run; `eval` without `--dataset` loads it again from there.
        tracker: the tracker, its options and weights.
        enhancer: the enhancer, None for the plain tracker.
        scope: what was enhanced, "patch" or "frame".
        device: "cpu" or "cuda".
        threads: computing threads of each worker.
        on_bad_frame: "error", or "skip": frames that cannot be read repeat the last box.
        repeatable: whether the same run gives the same bytes again.
        sessions: every call that worked on it.
        failures: reason by sequence, for those that have no result.
        starts: by sequence, what tells its length and first box (`Sequence.start_digest`).
        skipped_frames: by sequence, the 0-based numbers of the frames that could not be read.
        timing: over all finished sequences.
        format: version of this layout.
    """

    dataset: DatasetRecord
    tracker: PluginRecord
    enhancer: PluginRecord | None = None
    scope: str = "patch"
    device: str = "cpu"
    threads: int = 1
    on_bad_frame: OnBadFrame = "error"
    repeatable: bool = True
    sessions: list[Session] = []
    failures: dict[str, str] = {}
    starts: dict[str, str] = {}
    skipped_frames: dict[str, list[int]] = {}
    timing: StageTimes | None = None
    format: int = FORMAT

    @property
    def run(self) -> str:
        """The name of the run folder."""
        return run_name(self.tracker.title, self.enhancer.title if self.enhancer else "none")


@dataclass(frozen=True, slots=True)
class Track:
    """What a tracker did on one sequence.

    Attributes:
        boxes: float64 (n, 4).
        seconds: float64 (n, 3) of `STAGES`.
        skipped: 0-based numbers of the frames that could not be read; their boxes are repeated.
    """

    boxes: Boxes
    seconds: Floats
    skipped: tuple[int, ...] = ()


def run_name(tracker: str, enhancer: str) -> str:
    """`TRACKER[@LABEL]`, followed by `+ENHANCER[@LABEL]` unless that is "none"."""
    return tracker if enhancer == "none" else f"{tracker}+{enhancer}"


def split_run_name(name: str) -> tuple[str, str]:
    """(tracker, enhancer) of a run folder; a foreign name is taken whole, enhancer "none"."""
    match = _RUN_NAME.fullmatch(name)
    return (match["tracker"], match["enhancer"] or "none") if match else (name, "none")


class RunFolder:
    """One `RESULTS/DATASET/RUN` folder."""

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)

    @property
    def name(self) -> str:
        """The run's name."""
        return self.path.name

    def box_file(self, sequence: str) -> Path:
        """Where the boxes of a sequence are kept."""
        return self.path / f"{sequence}.txt"

    def time_file(self, sequence: str) -> Path:
        """Where the times of a sequence are kept."""
        return self.path / "time" / f"{sequence}.csv"

    def skipped_file(self, sequence: str) -> Path:
        """Where the numbers of skipped frames of a sequence are kept, if there are any."""
        return self.path / "skipped" / f"{sequence}.csv"

    def has(self, sequence: str) -> bool:
        """Whether the sequence is finished."""
        return self.box_file(sequence).is_file()

    def finished(self) -> list[str]:
        """Names of all finished sequences, sorted."""
        return sorted(p.stem for p in self.path.glob("*.txt") if not p.name.startswith("."))

    def boxes(self, sequence: str) -> Boxes:
        """Stored boxes, float64 (n, 4); every separator that foreign writers use is read."""
        return read_boxes(self.box_file(sequence))

    def seconds(self, sequence: str) -> Floats:
        """Stored seconds of `STAGES`, float64 (n, 3)."""
        path = self.time_file(sequence)
        _, _, body = path.read_text().partition("\n")
        return parse_rows(body, str(path), (len(STAGES),))

    def write(self, sequence: str, track: Track) -> None:
        """Store one finished sequence; the boxes last, since they say that it is finished."""
        skipped = self.skipped_file(sequence)
        if track.skipped:
            write_atomic(skipped, "".join(f"{number}\n" for number in track.skipped))
        else:
            skipped.unlink(missing_ok=True)
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

    def clean(self) -> None:
        """Remove what killed processes have left half written."""
        for folder in (self.path, self.path / "time", self.path / "skipped"):
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
        except msgspec.MsgspecError as error:
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
            np.delete(table, skipped.get(s, []), axis=0)
            for s, table in stored.items()
            if len(table)
        ]
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


def open_run(folder: RunFolder, wanted: Manifest) -> Manifest:
    """The stored manifest if it agrees with `wanted`, else `wanted` for a new folder.

    Raises:
        ResultConflict: the folder was made with other options, weights, scope, device or threads
            (says which), or holds results without a manifest.
    """
    stored = folder.manifest()
    if stored is None:
        if folder.path.is_dir() and folder.finished():
            msg = f"{folder.path}: holds results without run.json; choose another --results folder"
            raise ResultConflict(msg)
        return wanted
    differences = _differences(stored, wanted)
    if differences:
        msg = (
            f"{folder.path} was made with other settings: {'; '.join(differences)}; "
            f"give this run a label ({wanted.tracker.name}@LABEL) or another --results folder"
        )
        raise ResultConflict(msg)
    return stored


def _differences(stored: Manifest, wanted: Manifest) -> list[str]:
    old, new = _identity(stored), _identity(wanted)
    return [
        f"{key} {old.get(key, 'unset')} (now {new.get(key, 'unset')})"
        for key in sorted({*old, *new})
        if old.get(key) != new.get(key)
    ]


def _identity(manifest: Manifest) -> dict[str, Any]:
    """What two calls must share to work on one run folder."""
    identity: dict[str, Any] = {
        "device": manifest.device,
        "threads": manifest.threads,
        "on_bad_frame": manifest.on_bad_frame,
    }
    if manifest.enhancer:
        identity["scope"] = manifest.scope
    for record in (manifest.tracker, manifest.enhancer):
        if record is None:
            continue
        for key, value in record.options.items():
            if key != "scope":
                identity[f"{record.title}.{key}"] = value
        if record.weights:
            digest = record.weights.sha256[:12] or record.weights.origin
            identity[f"weights of {record.title}"] = digest
    return identity


def _read_numbers(path: Path) -> list[int]:
    try:
        return [int(line) for line in path.read_text().split()]
    except ValueError:
        msg = f"{path}: expected one frame number a line; move the file away"
        raise ResultConflict(msg) from None


def dataset_folder(results: str | Path, dataset: str) -> Path:
    """The folder of a dataset's runs: `RESULTS/DATASET`, or `results` itself if it holds runs.

    Raises:
        DatasetNotFound: neither is there; names what is.
    """
    results = check_results(results)
    nested = results / dataset
    if nested.is_dir() and list_runs(nested):
        return nested
    if list_runs(results):
        return results
    there = ", ".join(folder.name for folder in list_datasets(results)) or "nothing"
    msg = f"{results}: no results of {dataset}; it holds {there}"
    raise DatasetNotFound(msg)


def check_results(results: str | Path) -> Path:
    """The results folder, if it is one; else `DatasetNotFound`."""
    results = Path(results)
    if (results / "run.json").is_file():
        msg = f"{results}: this is one run; name the folder of its dataset, {results.parent}"
        raise DatasetNotFound(msg)
    if not results.is_dir():
        msg = f"{results}: no such results folder; `nat-bench run` makes one"
        raise DatasetNotFound(msg)
    return results


def list_datasets(results: str | Path) -> list[Path]:
    """Folders under `results` that hold runs, one a dataset."""
    return [child for child in _subfolders(results) if list_runs(child)]


def list_runs(folder: str | Path) -> list[RunFolder]:
    """Run folders directly under `folder`: those with a manifest or with text files."""
    runs = map(RunFolder, _subfolders(folder))
    return [run for run in runs if (run.path / "run.json").is_file() or run.finished()]


def _subfolders(folder: str | Path) -> list[Path]:
    return sorted(p for p in Path(folder).iterdir() if p.is_dir() and not p.name.startswith("."))
