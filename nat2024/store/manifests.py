"""What made a run folder, as its `run.json` keeps it."""

import re
from typing import Any, Literal, TypeAlias

import msgspec

OnBadFrame: TypeAlias = Literal["error", "skip"]
"""What to do with a frame that cannot be read."""

FORMAT = 1
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
    """One call of the engine that worked on a run.

    Attributes:
        started: when, in UTC.
        finished: when; empty where it was killed or is still at it.
        workers: number of processes.
        read_ahead: frames decoded ahead.
        together: combinations that shared decoded frames, at most.
        cluster: kind or address of the cluster, empty for one machine.
        shard: `I/N` where it was one of N parts of a dataset.
        process: tells this call from all others.
        versions: of what results depend on.
        machine: where it ran.
    """

    started: str
    finished: str = ""
    workers: int = 1
    read_ahead: int = 0
    together: int = 1
    cluster: str = ""
    shard: str = ""
    process: str = ""
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


class ImportRecord(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Where a run of another toolkit was taken from: its name there, its layout and its place."""

    name: str
    layout: str
    source: str


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
        batch: sequences that advance in one forward.
        repeatable: whether the same run gives the same bytes again.
        sessions: every call that worked on it.
        failures: reason by sequence, for those that have no result.
        starts: by sequence, what tells its length and first box (`Sequence.start_digest`).
        skipped_frames: by sequence, the 0-based numbers of the frames that could not be read.
        other_backends: by sequence and plugin, the backends that ran it, where that is not just the
            one of its options: it failed its check there, and others took over.
        timing: over all finished sequences.
        imported: where the run was taken from, if another program tracked it; `scope`, `device`
            and `threads` are then empty.
        format: version of this layout.
    """

    dataset: DatasetRecord
    tracker: PluginRecord
    enhancer: PluginRecord | None = None
    scope: str = "patch"
    device: str = "cpu"
    threads: int = 1
    on_bad_frame: OnBadFrame = "error"
    batch: int = 1
    repeatable: bool = True
    sessions: list[Session] = []
    failures: dict[str, str] = {}
    starts: dict[str, str] = {}
    skipped_frames: dict[str, list[int]] = {}
    other_backends: dict[str, dict[str, list[str]]] = {}
    timing: StageTimes | None = None
    imported: ImportRecord | None = None
    format: int = FORMAT

    @property
    def run(self) -> str:
        """The name of the run folder."""
        return run_name(self.tracker.title, self.enhancer.title if self.enhancer else "none")


def run_name(tracker: str, enhancer: str) -> str:
    """`TRACKER[@LABEL]`, followed by `+ENHANCER[@LABEL]` unless that is "none"."""
    return tracker if enhancer == "none" else f"{tracker}+{enhancer}"


def split_run_name(name: str) -> tuple[str, str]:
    """(tracker, enhancer) of a run folder; a foreign name is taken whole, enhancer "none"."""
    match = _RUN_NAME.fullmatch(name)
    return (match["tracker"], match["enhancer"] or "none") if match else (name, "none")
