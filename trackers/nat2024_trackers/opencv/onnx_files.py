"""Finding the two ONNX files of NanoTrack in a folder, whatever version of their names it has.

The authors publish `nanotrack_backbone_sim.onnx` and `nanotrack_head_sim.onnx` in a folder for each
version; collections rename them to `nanotrackv2_backbone.onnx` and the like.
"""

import dataclasses
import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import msgspec

from nat2024.cards import Card, WeightsFile
from nat2024.errors import InvalidOption, WeightsMismatch, WeightsMissing
from nat2024.files import expand
from nat2024.zoo import Weights, WeightsSpec, find_weights, sha256_of

_VERSION = re.compile(r"v(\d)(?!\d)", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class OnnxPair:
    """Backbone and head of one NanoTrack version."""

    backbone: Path
    head: Path

    def __str__(self) -> str:
        """Both paths."""
        return f"{self.backbone} and {self.head.name}"


def find_onnx_weights(
    name: str, spec: WeightsSpec, card: Card, variant: str, runnable: Sequence[str]
) -> tuple[OnnxPair, Weights]:
    """The two files of a variant for the tracker `name`, and what a manifest keeps of them.

    Args:
        name: of the tracker.
        spec: the folder that holds both; None for what is registered.
        card: which lists the published ONNX files with their digests.
        variant: such as "v1".
        runnable: the variants that the tracker can run.

    Raises:
        InvalidOption: fresh weights, which ONNX files do not have.
        WeightsMissing: no folder, or one of the two files is not in it.
        WeightsMismatch: the files are of another variant, or several would do.
    """
    found, folder = find_folder(name, spec, _wanted(card, variant), "both ONNX files")
    pair = find_pair(folder, variant, runnable)
    return pair, _identified(found, pair, card, variant, runnable)


def find_folder(name: str, spec: WeightsSpec, card: Card, files: str) -> tuple[Weights, Path]:
    """The folder of weights of the tracker `name`, and what a manifest keeps of it.

    Of a given folder no digest is taken: it may hold anything besides the files in use.

    Args:
        name: of the tracker.
        spec: the folder; None for what is registered.
        card: whose one file says what a user has to get.
        files: what the folder holds, for errors.

    Raises:
        InvalidOption: fresh weights, which ONNX files do not have.
        WeightsMissing: no folder.
    """
    if spec is False:
        msg = f"{name} has no fresh weights as ONNX; pass the folder that holds {files}"
        raise InvalidOption(msg)
    if isinstance(spec, str | os.PathLike) and str(spec) and expand(spec).is_dir():
        return Weights(expand(spec), "given"), expand(spec)
    found = find_weights(name, spec, card)
    folder = found.path or Path()
    if not folder.is_dir():
        msg = f"weights of {name}: {folder}: pass the folder that holds {files}"
        raise WeightsMissing(msg)
    return found, folder


def find_pair(folder: Path, variant: str, runnable: Sequence[str] = ("v1", "v2", "v3")) -> OnnxPair:
    """The backbone and the head of a variant ("v1", "v2", "v3") in a folder.

    Raises:
        WeightsMissing: one of them, or both, are not there; says which.
        WeightsMismatch: the files are of a variant that cannot run or of another one, or several
            would do.
    """
    files = sorted(p for p in folder.iterdir() if p.suffix.lower() == ".onnx" and p.is_file())
    found = {part: _choose(folder, files, part, variant, runnable) for part in ("backbone", "head")}
    missing = [f"*{part}*.onnx" for part, path in found.items() if path is None]
    if missing:
        there = ", ".join(path.name for path in files) or "no ONNX file"
        msg = (
            f"{folder}: no {' and no '.join(missing)} of NanoTrack {variant} in it "
            f"(it holds {there}); both are needed"
        )
        raise WeightsMissing(msg)
    return OnnxPair(*(path for path in found.values() if path is not None))


def _choose(
    folder: Path, files: list[Path], part: str, variant: str, runnable: Sequence[str]
) -> Path | None:
    """The one file of a part: by the version in its name, else one whose name has no version."""
    parts = [path for path in files if part in path.stem.lower()]
    for version in (variant, None):
        matching = [path for path in parts if _version_of(path) == version]
        if len(matching) > 1:
            names = ", ".join(path.name for path in matching)
            msg = f"{folder}: several files would do as {part} of NanoTrack {variant}: {names}"
            raise WeightsMismatch(msg)
        if matching:
            return matching[0]
    others = sorted({_version_of(path) or "" for path in parts})
    if not others:
        return None
    usable = [version for version in others if version in runnable]
    if usable:
        msg = f"{folder}: {parts[0].name} is of NanoTrack {usable[0]}; pass variant={usable[0]}"
    else:
        msg = (
            f"{folder}: {parts[0].name} is of NanoTrack {others[0]}, which OpenCV's tracker cannot "
            f"run (15x15 map, it expects 16x16); use the files of {' or '.join(runnable)}"
        )
    raise WeightsMismatch(msg)


def _identified(
    found: Weights, pair: OnnxPair, card: Card, variant: str, runnable: Sequence[str]
) -> Weights:
    """The weights with the digest of the two files only, and their published names."""
    names = []
    for path in (pair.backbone, pair.head):
        file = card.published_file(sha256_of(path))
        if file and file.variant not in ("", variant):
            msg = f"{path}: is a file of NanoTrack {file.note}, not of variant {variant}"
            if file.variant in runnable:
                msg = f"{path}: is a file of NanoTrack {file.variant}; pass variant={file.variant}"
            raise WeightsMismatch(msg)
        names.append(file.name if file else "")
    return dataclasses.replace(
        found,
        sha256=sha256_of(pair.backbone, pair.head),
        known_as=" and ".join(names) if all(names) else "",
        files=(pair.backbone, pair.head),
    )


def _wanted(card: Card, variant: str) -> Card:
    """The card with both files of a variant as the one thing that a user has to get."""
    files = [file for file in card.weights if file.variant == variant]
    folder = WeightsFile(
        name=" and ".join(file.name for file in files) + ", both in one folder",
        where=files[0].where,
        licence=files[0].licence,
    )
    return msgspec.structs.replace(card, weights=(folder,))


def _version_of(path: Path) -> str | None:
    match = _VERSION.search(path.stem)
    return f"v{match[1]}" if match else None
