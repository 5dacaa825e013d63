"""`manifest.json` with `boxes/RUN/SEQ.csv`: the bundle that `nat-bench export` writes."""

import functools
import hashlib
from collections.abc import Mapping
from pathlib import Path

import msgspec

from nat2024.boxes import parse_boxes
from nat2024.errors import BoxFileError
from nat2024.importing.runs import ForeignRun
from nat2024.importing.tree import Folder, read_file
from nat2024.types import Boxes

NAME = "bundle"
WORDS = "manifest.json and boxes/RUN/SEQUENCE.csv (bundle of nat-bench)"

MANIFEST = "manifest.json"
FORMAT = "nat-bench results 1"
HEADER = "x,y,w,h\n"


class BundledRun(msgspec.Struct, frozen=True):
    """One run in a bundle.

    Attributes:
        run: its name, and that of its folder.
        tracker: name, with its label.
        enhancer: name, with its label; "none" for the plain tracker.
        sha256: of each file of boxes, by sequence.
        sha256_all: of `SEQUENCE SHA256` lines in sorted order; tells whole runs apart.
        folder: name of its folder in the bundle.
    """

    run: str
    tracker: str
    enhancer: str
    folder: str
    sha256: dict[str, str]
    sha256_all: str


class BundleManifest(msgspec.Struct, frozen=True):
    """What is in a bundle.

    Attributes:
        format: name and version of this layout.
        dataset: name of the dataset.
        protocol: the one-pass protocol that its owner scores it by.
        runs: every run.
    """

    format: str
    dataset: str
    protocol: str
    runs: list[BundledRun]


def find(folder: Folder) -> list[ForeignRun]:
    """The runs of a bundle; none where there is no manifest of one.

    Raises:
        BoxFileError: its manifest cannot be used.
    """
    if MANIFEST not in folder.files or "boxes" not in folder.folders:
        return []
    path = folder.path / MANIFEST
    try:
        manifest = msgspec.json.decode(read_file(path), type=BundleManifest)
    except (ValueError, RecursionError) as error:  # no UTF-8 and endless nesting too
        msg = f"{path}: no manifest of a bundle ({error})"
        raise BoxFileError(msg) from None
    if manifest.format != FORMAT:
        msg = f"{path}: format {manifest.format!r}, this version reads {FORMAT!r}"
        raise BoxFileError(msg)
    boxes = folder.child("boxes")
    return [_run(folder, boxes, manifest, run) for run in manifest.runs]


def _run(folder: Folder, boxes: Folder, manifest: BundleManifest, run: BundledRun) -> ForeignRun:
    if run.folder not in boxes.folders:  # its text must not lead anywhere else
        msg = f"{folder.path / MANIFEST}: the bundle has no folder boxes/{run.folder}"
        raise BoxFileError(msg)
    own = boxes.child(run.folder)
    found = {n[: -len(".csv")]: (own.path / n,) for n in own.files if n.endswith(".csv")}
    holder = folder.path / "times" / run.folder
    timed = set(folder.child("times").child(run.folder).files) if _has_times(folder) else set()
    return ForeignRun(
        name=run.run,
        path=own.path,
        layout=NAME,
        files=found,
        times={s: holder / f"{s}.csv" for s in found if f"{s}.csv" in timed},
        load=functools.partial(_load, run.sha256),
        parse=_parse,
        named=(run.tracker, run.enhancer),
        dataset=manifest.dataset,
    )


def _has_times(folder: Folder) -> bool:
    return "times" in folder.folders


def _load(digests: Mapping[str, str], path: Path) -> bytes:
    raw = read_file(path)
    if hashlib.sha256(raw).hexdigest() != digests.get(path.stem):
        msg = f"{path}: altered since it was exported (its sha256 is not the manifest's)"
        raise BoxFileError(msg)
    return raw


def _parse(raw: bytes, path: Path) -> Boxes:
    text = raw.decode("utf-8", "replace").removeprefix(HEADER)
    return parse_boxes(text, source=str(path))
