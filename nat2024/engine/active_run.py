"""One combination's run folder on its way: opened, written to, closed; never by one call alone.

Several calls may work on one folder at a time: box files are whole or absent, and manifests are
changed under a lock, each call adding what it knows.
"""

import contextlib
import logging
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import msgspec

from nat2024.engine.machine import timestamp, version_differences
from nat2024.engine.plan import Combination
from nat2024.engine.units import Outcome
from nat2024.errors import NatBenchError, ResultConflict
from nat2024.store import Manifest, RunFolder, Session, StageTimes, open_run
from nat2024.store.opening import Untouched
from nat2024.types import Dataset, Sequence

log = logging.getLogger("nat2024")


@dataclass(slots=True)
class ActiveRun:
    """One combination on its way.

    Attributes:
        combination: what runs.
        folder: where its results go.
        wanted: the manifest that it would write into an empty folder.
        missing: names of the sequences without a result.
        failures: reason by sequence, of this call.
        untouched: options at their defaults; see `open_run`.
    """

    combination: Combination
    folder: RunFolder
    wanted: Manifest
    missing: list[str]
    failures: dict[str, str]
    untouched: Untouched
    _session: Session | None = None

    @classmethod
    def open(
        cls,
        combination: Combination,
        wanted: Manifest,
        untouched: Untouched,
        dataset: Dataset,
        results: Path,
    ) -> "ActiveRun":
        """Look at what is there; nothing is written.

        Args:
            combination: what is to be run.
            wanted: its manifest.
            untouched: its options that are at their defaults.
            dataset: what it is run on.
            results: the folder of the dataset.

        Raises:
            ResultConflict: the folder was made with other settings, or on another dataset.
        """
        folder = RunFolder(results / combination.run)
        stored = open_run(folder, wanted, untouched)
        missing = [s.name for s in dataset if not _is_finished(folder, stored, s)]
        wanted.starts |= {name: dataset[name].start_digest() for name in missing}
        return cls(combination, folder, wanted, missing, {}, untouched)

    def begin(self, session: Session) -> None:
        """Open a session, in a run that has something left to do.

        Raises:
            ResultConflict: somebody has just begun the same run with other settings.
        """
        if not self.missing:
            return
        self._session = msgspec.structs.replace(session)
        self.folder.clean()
        with self.folder.alone():
            manifest = open_run(self.folder, self.wanted, self.untouched)
            manifest.starts |= self.wanted.starts
            self._tell_other_versions(manifest, session)
            manifest.sessions.append(self._session)
            self.folder.write_manifest(manifest)

    def keep(self, outcome: Outcome) -> bool:
        """Write a track, or note why there is none; gives whether there is a result now."""
        reason = outcome.reason
        if outcome.track is not None:
            try:
                if not self.folder.has(outcome.sequence):  # else another call was faster
                    self.folder.write(outcome.sequence, outcome.track)
            except (NatBenchError, OSError) as error:
                reason = str(error)
        if reason:
            log.error("%s, %s: %s", self.combination.run, outcome.sequence, reason)
            self.failures[outcome.sequence] = reason
        return not reason

    def finish(self) -> None:
        """Close the session; the manifest gets times and failures."""
        if self._session is None:
            return
        self.folder.clean()
        with self.folder.alone():
            manifest = self._manifest()
            manifest.timing = stage_times(self.folder)
            manifest.skipped_frames = self.folder.skipped_frames()
            manifest.other_backends = self.folder.other_backends()
            finished, failures = {*self.folder.finished()}, {**manifest.failures, **self.failures}
            manifest.failures = {n: why for n, why in failures.items() if n not in finished}
            for session in manifest.sessions:
                if session.process == self._session.process:
                    session.finished = timestamp()
            self.folder.write_manifest(manifest)
        self._tell_skipped(manifest)

    def _manifest(self) -> Manifest:
        """The stored manifest, which other calls may have changed meanwhile."""
        with contextlib.suppress(ResultConflict):
            stored = self.folder.manifest()
            if stored is not None:
                return stored
        assert self._session is not None
        self.wanted.sessions = [self._session]  # somebody took it away
        return self.wanted

    def _tell_other_versions(self, manifest: Manifest, session: Session) -> None:
        changes = version_differences(manifest.sessions, [session])
        if changes:
            log.warning(
                "%s goes on with other versions than it began with, boxes may depend on them: %s",
                self.combination.run,
                "; ".join(changes),
            )

    def _tell_skipped(self, manifest: Manifest) -> None:
        for name, frames in manifest.skipped_frames.items():
            if name in self.missing:
                shown = ", ".join(map(str, frames[:10])) + (", ..." if len(frames) > 10 else "")
                log.warning(
                    "%s, %s: %d frames cannot be read, the last box is repeated: %s"
                    " (counted from 0)",
                    self.combination.run,
                    name,
                    len(frames),
                    shown,
                )


def bundled_weights(manifest: Manifest) -> Iterator[str]:
    """A line for each plugin of a run whose weights come with a package."""
    for plugin in (manifest.tracker, manifest.enhancer):
        if plugin and plugin.weights and plugin.weights.origin == "bundled":
            yield (
                f"{plugin.shown}: weights {plugin.weights.known_as}, which come with the package; "
                f"others by --weights {plugin.title}=PATH or nat-bench weights import {plugin.name}"
            )


def _is_finished(folder: RunFolder, manifest: Manifest, sequence: Sequence) -> bool:
    if not folder.has(sequence.name):
        return False
    path, rows = folder.box_file(sequence.name), len(folder.boxes(sequence.name))
    if rows != len(sequence):
        msg = f"{path}: {rows} rows, but the sequence has {len(sequence)} frames; move it away"
        raise ResultConflict(msg)
    if manifest.starts.get(sequence.name, sequence.start_digest()) != sequence.start_digest():
        msg = (
            f"{path}: made on another dataset, whose {sequence.name} has another length or first "
            "box; move it away, or choose another --results folder"
        )
        raise ResultConflict(msg)
    return True


def stage_times(folder: RunFolder) -> StageTimes | None:
    """Mean times of a run folder; None, with a line of log, where they cannot be read."""
    try:
        return folder.stage_times()
    except NatBenchError as error:  # times are no reason to lose what was tracked
        log.warning("no timing: %s", error)
        return None
