"""Bringing results together that were made apart: shards, machines, people."""

import logging
import re
from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import msgspec

from nat2024.engine.active_run import stage_times
from nat2024.engine.machine import version_differences
from nat2024.errors import DatasetNotFound, ResultConflict
from nat2024.files import write_atomic
from nat2024.store import Manifest, RunFolder, setting_differences

log = logging.getLogger("nat2024")

_SHARD = re.compile(r"(?P<number>[0-9]{1,9})/(?P<count>[0-9]{1,9})")
_SHOWN = 5
_DATASET_PARTS = (
    "name",
    "lenient",
    "rule",
)  # the rest is where it lies, which machines may differ in


@dataclass(frozen=True, slots=True)
class MergeReport:
    """What `merge_results` did.

    Attributes:
        folder: where all is now.
        runs: `DATASET/RUN` of each.
        copied: sequences that were copied, over all runs.
        present: sequences that were there already, with the same boxes.
        failures: sequences that some source failed on and no source has a result of.
        incomplete: a line for each run that lacks something, as far as manifests tell.
    """

    folder: Path
    runs: tuple[str, ...]
    copied: int
    present: int
    failures: int
    incomplete: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class _Part:
    """One run folder of one source, with its manifest."""

    folder: RunFolder
    manifest: Manifest


def merge_results(
    sources: Iterable[str | Path], out: str | Path, *, other_versions: bool = False
) -> MergeReport:
    """Bring results folders together; everything is checked before anything is written.

    Args:
        sources: results folders, each with `DATASET/RUN` folders.
        out: where all goes; results that are there already take part as a source does.
        other_versions: whether sources may have been made with other versions of libraries.

    Raises:
        DatasetNotFound: a source holds no results.
        ResultConflict: two sources made a run with other settings or versions, on other sequences
            of the same names, or got other boxes; or a run has no manifest.
    """
    out = Path(out)
    found = [_parts(Path(source)) for source in sources]
    present = _parts(out) if out.is_dir() and any(out.iterdir()) else {}
    plan = {
        name: [parts[name] for parts in (present, *found) if name in parts]
        for name in sorted({name for parts in (present, *found) for name in parts})
    }
    merged = {
        name: _merge_manifests(parts, other_versions=other_versions) for name, parts in plan.items()
    }
    chosen = {name: _choose(parts) for name, parts in plan.items()}
    copied = failures = 0
    incomplete: list[str] = []
    for name, manifest in merged.items():
        target = RunFolder(out / name)
        target.clean()
        with target.alone():
            target.write_manifest(manifest)  # first: a merge that is cut off can be done again
            for sequence, source in chosen[name].items():
                if not target.has(sequence):
                    _copy(sequence, source.folder, target)
                    copied += 1
            manifest.timing = stage_times(target)
            manifest.skipped_frames = target.skipped_frames()
            manifest.other_backends = target.other_backends()
            finished = {*target.finished()}
            left = manifest.failures.items()
            manifest.failures = {n: why for n, why in left if n not in finished}
            failures += len(manifest.failures)
            incomplete += [f"{name}: {what}" for what in _missing(manifest, target)]
            target.write_manifest(manifest)
    total = sum(len(sequences) for sequences in chosen.values())
    for line in incomplete:
        log.warning("%s", line)
    return MergeReport(
        out, tuple(merged), copied, total - copied, failures, incomplete=tuple(incomplete)
    )


def _missing(manifest: Manifest, folder: RunFolder) -> list[str]:
    """What is not there and was to be there: whole shards, and sequences that were begun."""
    lines = []
    shards = [_SHARD.fullmatch(session.shard) for session in manifest.sessions]
    counts = {shard and int(shard["count"]) for shard in shards}
    if len(counts) == 1 and (count := counts.pop()):  # all of them parts of one division
        there = {int(shard["number"]) for shard in shards if shard}
        # Lazily: a manifest may claim to be one of a thousand million shards.
        absent = (str(number) for number in range(1, count + 1) if number not in there)
        some = list(islice(absent, _SHOWN + 1))
        if some:
            lines.append(f"without shard {_few(some)} of {count}")
    left = sorted({*manifest.starts} - {*manifest.failures} - {*folder.finished()})
    if left:
        lines.append(f"begun and not finished: {_few(left)}")
    return lines


def _few(names: list[str]) -> str:
    return ", ".join(names[:_SHOWN]) + (", ..." if len(names) > _SHOWN else "")


def _parts(source: Path) -> dict[str, _Part]:
    """Run folders of a results folder by `DATASET/RUN`."""
    found = {}
    for path in sorted(source.glob("*/*")) if source.is_dir() else ():
        folder = RunFolder(path)
        if not path.is_dir() or path.name.startswith("."):
            continue
        manifest = folder.manifest()
        if manifest is not None:
            found[f"{path.parent.name}/{path.name}"] = _Part(folder, manifest)
        elif folder.finished():
            msg = f"{path}: holds results without run.json, so nobody can say what they belong to"
            raise ResultConflict(msg)
    if not found:
        msg = f"{source}: no results in it; name folders that hold DATASET/RUN folders"
        raise DatasetNotFound(msg)
    return found


def _merge_manifests(parts: list[_Part], *, other_versions: bool) -> Manifest:
    """One manifest that tells of all.

    Raises:
        ResultConflict: they do not belong together.
    """
    first = parts[0]
    manifest: Manifest = msgspec.convert(msgspec.to_builtins(first.manifest), Manifest)
    for part in parts[1:]:
        other = part.manifest
        differences = setting_differences(manifest, other) + _other_dataset(manifest, other)
        if differences:
            msg = (
                f"{part.folder.path} was made with other settings than {first.folder.path}: "
                f"{'; '.join(differences)}"
            )
            raise ResultConflict(msg)
        changes = version_differences(first.manifest.sessions, other.sessions)
        if changes and not other_versions:
            msg = (
                f"{part.folder.path} was made with other versions than {first.folder.path}: "
                f"{'; '.join(changes)}; boxes may depend on them "
                "(--other-versions brings them together all the same)"
            )
            raise ResultConflict(msg)
        known = {session.process for session in manifest.sessions if session.process}
        manifest.sessions += [s for s in other.sessions if s.process not in known]
        manifest.starts = {**manifest.starts, **other.starts}
        manifest.failures = {**manifest.failures, **other.failures}
        manifest.repeatable = manifest.repeatable and other.repeatable
    manifest.sessions.sort(key=lambda session: session.started)
    return manifest


def _other_dataset(one: Manifest, other: Manifest) -> list[str]:
    differences = [
        f"dataset {part} {getattr(one.dataset, part)} (now {getattr(other.dataset, part)})"
        for part in _DATASET_PARTS
        if getattr(one.dataset, part) != getattr(other.dataset, part)
    ]
    altered = sorted(
        name for name in {*one.starts} & {*other.starts} if one.starts[name] != other.starts[name]
    )
    if altered:
        differences.append(f"length or first box of {', '.join(altered)}")
    return differences


def _choose(parts: list[_Part]) -> Mapping[str, _Part]:
    """For each finished sequence the first source that has it.

    Raises:
        ResultConflict: two sources have other boxes of it.
    """
    by_sequence: dict[str, list[_Part]] = defaultdict(list)
    for part in parts:
        for sequence in part.folder.finished():
            by_sequence[sequence].append(part)
    for sequence, some in by_sequence.items():
        first = some[0].folder.box_file(sequence)
        for part in some[1:]:
            other = part.folder.box_file(sequence)
            if other.read_bytes() != first.read_bytes():
                msg = f"{other} and {first} hold other boxes; remove one of them"
                raise ResultConflict(msg)
    return {sequence: some[0] for sequence, some in by_sequence.items()}


def _copy(sequence: str, source: RunFolder, target: RunFolder) -> None:
    """Files as they are, boxes last, since they say that the sequence is finished."""
    for pick in (
        RunFolder.skipped_file,
        RunFolder.backends_file,
        RunFolder.time_file,
        RunFolder.box_file,
    ):
        path = pick(source, sequence)
        if path.is_file():
            write_atomic(pick(target, sequence), path.read_bytes())
