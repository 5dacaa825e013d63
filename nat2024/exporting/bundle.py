"""`DATASET.zip`: one file with boxes, times and a manifest that has the hash of every result."""

import hashlib
import io
import zipfile
from collections.abc import Sequence
from pathlib import Path

import msgspec

from nat2024.boxes import format_boxes
from nat2024.exporting.taking import TakenRun
from nat2024.files import write_atomic
from nat2024.importing.bundles import (
    FORMAT,
    HEADER,
    MANIFEST,
    BundledRun,
    BundleManifest,
)
from nat2024.store import DatasetRecord

WORDS = "DATASET.zip: manifest.json, boxes/RUN/SEQUENCE.csv, times/RUN/SEQUENCE.csv of seconds"

_PROTOCOL = "pysot"
_EPOCH = (1980, 1, 1, 0, 0, 0)  # equal results make equal bytes


def write(runs: Sequence[TakenRun], dataset: DatasetRecord, out: Path) -> dict[str, Path]:
    """Write all runs of a dataset into one archive; gives it for each."""
    path = out / f"{dataset.name}.zip"
    members: dict[str, bytes] = {}
    entries = []
    for number, run in enumerate(sorted(runs, key=lambda run: run.name), 1):
        folder = _folder(run.name, number)
        texts = {n: (HEADER + format_boxes(boxes)).encode() for n, boxes in run.boxes.items()}
        members |= {f"boxes/{folder}/{name}.csv": text for name, text in texts.items()}
        members |= {
            f"times/{folder}/{name}.csv": _seconds(seconds.tolist())
            for name, seconds in run.seconds.items()
        }
        digests = {name: hashlib.sha256(text).hexdigest() for name, text in sorted(texts.items())}
        entries.append(_entry(run, folder, digests))
    manifest = BundleManifest(FORMAT, dataset.name, _PROTOCOL, entries)
    members[MANIFEST] = msgspec.json.format(msgspec.json.encode(manifest), indent=2) + b"\n"
    write_atomic(path, _packed(members))
    return {run.name: path for run in runs}


def _folder(name: str, number: int) -> str:
    """A folder name that is safe in every archive."""
    safe = "".join(c if c.isalnum() or c in "@+._-" else "_" for c in name)
    return safe if safe == name and name.strip(".") else f"run{number}"


def _seconds(seconds: list[float]) -> bytes:
    return "".join(f"{value:.8f}\n" for value in seconds).encode()


def _entry(run: TakenRun, folder: str, digests: dict[str, str]) -> BundledRun:
    lines = "".join(f"{name} {digest}\n" for name, digest in digests.items())
    total = hashlib.sha256(lines.encode()).hexdigest()
    return BundledRun(run.name, run.tracker, run.enhancer, folder, digests, total)


def _packed(members: dict[str, bytes]) -> bytes:
    raw = io.BytesIO()
    with zipfile.ZipFile(raw, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in sorted(members.items()):
            info = zipfile.ZipInfo(name, _EPOCH)
            info.compress_type = zipfile.ZIP_DEFLATED
            info.external_attr = 0o100644 << 16
            archive.writestr(info, data)
    return raw.getvalue()
