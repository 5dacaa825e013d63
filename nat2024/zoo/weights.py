"""Which weights a plugin gets: a path, what the user registered, what the package bundles."""

import hashlib
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, TypeAlias

from nat2024.cards import Card
from nat2024.errors import WeightsMissing
from nat2024.files import expand

WeightsSpec: TypeAlias = str | os.PathLike[str] | Literal[False] | None
"""A path, `False` for fresh initial weights, or `None` for the best that is at hand."""


@dataclass(frozen=True, slots=True)
class Weights:
    """The weights that a plugin was created with.

    Attributes:
        path: the file or folder, None for fresh initial weights.
        origin: how it was chosen: `given`, `registered`, `bundled` or `fresh`.
        sha256: digest of the file (of all files of a folder), empty for fresh weights.
        known_as: which published file of the card it is, empty where it is none of them.
    """

    path: Path | None
    origin: Literal["given", "registered", "bundled", "fresh"]
    sha256: str = ""
    known_as: str = ""


def find_weights(name: str, spec: WeightsSpec, card: Card) -> Weights:
    """Decide which weights the plugin `name` gets.

    Raises:
        WeightsMissing: the given path does not exist, or nothing is at hand; says which official
            file is expected, where it is to be had and how to pass it.
    """
    if spec is False:
        return Weights(None, "fresh")
    if spec is None:
        raise WeightsMissing(_how_to_get(name, card))
    if not isinstance(spec, str | os.PathLike) or not str(spec):
        msg = f"weights of {name} must be a path, False or None, not {spec!r}"
        raise WeightsMissing(msg)
    path = expand(spec)
    if not path.exists():
        msg = f"weights of {name}: {path}: no such file"
        raise WeightsMissing(msg)
    digest = sha256_of(path)
    known = next((f.name for f in card.weights if f.sha256 and f.sha256 == digest), "")
    return Weights(path, "given", digest, known)


def sha256_of(path: Path, *more: Path) -> str:
    """Hexadecimal sha256 of a file, or of the names and contents of several.

    A folder counts as all files directly in it.
    """
    digest = hashlib.sha256()
    if more or path.is_dir():
        files = (path, *more) if more else (p for p in path.iterdir() if p.is_file())
        for file in sorted(files, key=lambda file: file.name):
            digest.update(f"{file.name}\0{sha256_of(file)}\0".encode())
        return digest.hexdigest()
    with path.open("rb") as stream:
        while block := stream.read(1 << 20):
            digest.update(block)
    return digest.hexdigest()


def _how_to_get(name: str, card: Card) -> str:
    msg = f"no weights for {name}: pass them with --weights {name}=PATH (weights=PATH in Python)"
    if card.weights:
        choices = "; or ".join(f"{file.name} from {file.where}" for file in card.weights)
        msg += f"; the official file is {choices}"
    return msg
