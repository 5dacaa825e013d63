"""Finding the two ONNX files of NanoTrack in a folder, whatever version of their names it has.

The authors publish `nanotrack_backbone_sim.onnx` and `nanotrack_head_sim.onnx` in a folder for each
version; collections rename them to `nanotrackv2_backbone.onnx` and the like.
"""

import re
from dataclasses import dataclass
from pathlib import Path

from nat2024.errors import WeightsMismatch, WeightsMissing

_VERSION = re.compile(r"v(\d)(?!\d)", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class OnnxPair:
    """Backbone and head of one NanoTrack version."""

    backbone: Path
    head: Path

    def __str__(self) -> str:
        """Both paths."""
        return f"{self.backbone} and {self.head.name}"


def find_pair(folder: Path, variant: str) -> OnnxPair:
    """The backbone and the head of a variant ("v1", "v2") in a folder.

    Raises:
        WeightsMissing: one of them, or both, are not there; says which.
        WeightsMismatch: the files are of version 3 or another variant, or several would do.
    """
    files = sorted(p for p in folder.iterdir() if p.suffix.lower() == ".onnx" and p.is_file())
    found = {part: _choose(folder, files, part, variant) for part in ("backbone", "head")}
    missing = [f"*{part}*.onnx" for part, path in found.items() if path is None]
    if missing:
        there = ", ".join(path.name for path in files) or "no ONNX file"
        msg = (
            f"{folder}: no {' and no '.join(missing)} of NanoTrack {variant} in it "
            f"(it holds {there}); both are needed"
        )
        raise WeightsMissing(msg)
    return OnnxPair(*(path for path in found.values() if path is not None))


def _choose(folder: Path, files: list[Path], part: str, variant: str) -> Path | None:
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
    if others == ["v3"]:
        msg = (
            f"{folder}: {parts[0].name} is of NanoTrack v3, which OpenCV cannot run "
            "(15x15 map, it expects 16x16); use the files of v1 or v2"
        )
        raise WeightsMismatch(msg)
    if others:
        msg = f"{folder}: {parts[0].name} is of NanoTrack {others[0]}; pass variant={others[0]}"
        raise WeightsMismatch(msg)
    return None


def _version_of(path: Path) -> str | None:
    match = _VERSION.search(path.stem)
    return f"v{match[1]}" if match else None
