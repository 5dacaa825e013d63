"""nat-bench's own layout, `DATASET/RUN` with a manifest: what makes a foreign run one of ours."""

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from nat2024.exporting.taking import TakenRun
from nat2024.store import DatasetRecord, Manifest, PluginRecord, RunFolder, Track
from nat2024.types import Floats

WORDS = "DATASET/RUN/SEQUENCE.txt, time/SEQUENCE.csv, run.json"
LOSES = "times of stages are kept as one"


def write(runs: Sequence[TakenRun], dataset: DatasetRecord, out: Path) -> dict[str, Path]:
    """Write runs of a dataset, with the names that nat-bench has for them; gives their folders."""
    seen: Counter[str] = Counter()
    folders = {}
    for run in runs:
        seen[run.own_name] += 1
        number = seen[run.own_name]
        tracker = run.tracker if number == 1 else _numbered(run.tracker, number)
        manifest = run.manifest or _manifest(run, tracker, dataset)
        folder = RunFolder(out / dataset.name / manifest.run)
        for sequence, boxes in run.boxes.items():
            folder.write(sequence, Track(boxes, _stages(run, sequence)))
        if run.manifest is None and run.seconds:
            manifest.timing = folder.stage_times()
        folder.write_manifest(manifest)
        folders[run.name] = folder.path
    return folders


def _numbered(tracker: str, number: int) -> str:
    name, _, label = tracker.partition("@")
    return f"{name}@{label}{number}"


def _manifest(run: TakenRun, tracker: str, dataset: DatasetRecord) -> Manifest:
    return Manifest(
        dataset=dataset,
        tracker=_record(tracker),
        enhancer=None if run.enhancer == "none" else _record(run.enhancer),
        scope="",
        device="",
        threads=0,
        repeatable=False,
        imported=run.imported,
    )


def _record(title: str) -> PluginRecord:
    name, _, label = title.partition("@")
    return PluginRecord(name, label)


def _stages(run: TakenRun, sequence: str) -> Floats:
    """Seconds of the stages; other toolkits time a frame as a whole, which is tracking here."""
    seconds = run.seconds.get(sequence)
    if seconds is None:
        return np.empty((0, 3))
    return np.stack([np.zeros_like(seconds), np.zeros_like(seconds), seconds], axis=1)
