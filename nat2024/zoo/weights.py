"""Which weights a plugin gets: a path, what the user registered, what the package bundles."""

import hashlib
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib.resources import files
from pathlib import Path
from typing import Any, Literal, TypeAlias

from nat2024.cards import Card, WeightsFile
from nat2024.errors import InvalidOption, WeightsMismatch, WeightsMissing
from nat2024.files import expand
from nat2024.zoo.registered import (
    RegisteredWeights,
    choose_registered,
    describe_options,
    list_registered,
)

_CHOSEN = ("given", "fresh")


@dataclass(frozen=True, slots=True)
class Weights:
    """The weights that a plugin was created with.

    Attributes:
        path: the file or folder, None for fresh initial weights.
        origin: how it was chosen: `given`, `registered`, `bundled` or `fresh`.
        sha256: digest of the file (of all files of a folder), empty for fresh weights; for
            registered weights of the file that was imported, so that both ways are one run.
        known_as: which published file of the card it is, empty where it is none of them.
        options: options that registered weights were imported with, such as `variant`.
        files: which files of a folder are in use; empty for all.
    """

    path: Path | None
    origin: Literal["given", "registered", "bundled", "fresh"]
    sha256: str = ""
    known_as: str = ""
    options: Mapping[str, Any] = field(default_factory=dict)
    files: tuple[Path, ...] = ()


WeightsSpec: TypeAlias = str | os.PathLike[str] | Weights | Literal[False] | None
"""A path, `False` for fresh initial weights, `None` for the best that is at hand, or found ones."""


def find_weights(name: str, spec: WeightsSpec, card: Card) -> Weights:
    """Decide which weights the plugin `name` gets.

    None takes registered weights that were imported without options (`create_enhancer` and
    `create_tracker` choose among those with options), then those of the first file of `card` that
    comes with a package.

    Raises:
        WeightsMissing: the given path does not exist, or nothing is at hand; says which official
            file is expected, where it is to be had and how to pass it.
        WeightsMismatch: registered or bundled weights are damaged.
    """
    if isinstance(spec, Weights):
        return spec
    if spec is False:
        return Weights(None, "fresh")
    if spec is None:
        # weights with options are for a plugin that was created with these
        plain = [one for one in list_registered(name) if not one.options]
        found = _use(plain[0], card) if plain else find_bundled(name, card)
        if found is None:
            raise WeightsMissing(_how_to_get(name, card))
        return found
    if not isinstance(spec, str | os.PathLike) or not str(spec):
        msg = f"weights of {name} must be a path, False or None, not {spec!r}"
        raise WeightsMissing(msg)
    path = expand(spec)
    if not path.exists():
        msg = f"weights of {name}: {path}: no such file"
        raise WeightsMissing(msg)
    digest = sha256_of(path)
    return Weights(path, "given", digest, _name_of(card.published_file(digest)))


def find_registered(
    name: str, card: Card, given: Mapping[str, Any], defaults: Mapping[str, Any]
) -> Weights | None:
    """Registered weights of the plugin `name` that fit its options; None where there are none.

    Args:
        name: the plugin.
        card: its card.
        given: the options that its user gave; weights imported with others do not fit.
        defaults: the plugin's own options, which decide where several fit.

    Raises:
        WeightsMissing: several fit; names the options that tell them apart.
        WeightsMismatch: the stored file is gone or damaged.
    """
    chosen = choose_registered(name, given, defaults)
    return None if chosen is None else _use(chosen, card)


def _use(stored: RegisteredWeights, card: Card) -> Weights:
    if not stored.path.exists() or sha256_of(stored.path) != stored.sha256:
        what = "are damaged" if stored.path.exists() else "are gone"
        msg = (
            f"{stored.path}: the registered weights of {stored.plugin} {what}; import them anew "
            f"(nat-bench weights import {stored.plugin} FILE) or remove them "
            f"(nat-bench weights remove {stored.plugin})"
        )
        raise WeightsMismatch(msg)
    known_as = _name_of(card.published_file(stored.source_sha256)) or stored.known_as
    return Weights(stored.path, "registered", stored.source_sha256, known_as, stored.options)


def bundled_path(file: WeightsFile) -> Path | None:
    """Where a weights file that comes with a package lies; None for all others."""
    if not file.bundled:
        return None
    package, _, rest = file.bundled.partition("/")
    return Path(str(files(package).joinpath(rest)))


def preset_weights(name: str, preset: str | None, spec: WeightsSpec, card: Card) -> WeightsSpec:
    """Weights of a plugin with an option `preset`, which names weights that come with it.

    A preset that is named comes before registered weights. None changes nothing.

    Args:
        name: the plugin.
        preset: what its user asks for.
        spec: the weights that it was created with.
        card: its card, whose bundled files name their presets.

    Raises:
        InvalidOption: weights are given besides, or no bundled file has that preset.
        WeightsMismatch: the bundled file is damaged.
    """
    if preset is None:
        return spec
    if spec is False or (spec is not None and getattr(spec, "origin", "given") in _CHOSEN):
        msg = f"{name}.preset={preset} takes weights that come with the package; leave the option "
        msg += "or --weights out"
        raise InvalidOption(msg)
    found = find_bundled(name, card, preset)
    if found is None:
        known = ", ".join(file.preset for file in card.weights if file.preset)
        msg = f"no weights come with {name} for preset={preset}; there are {known or 'none'}"
        raise InvalidOption(msg)
    return found


def find_bundled(name: str, card: Card, preset: str = "") -> Weights | None:
    """The first weights file that comes with a package; of one preset where that is named.

    Raises:
        WeightsMismatch: it is damaged.
    """
    for file in card.weights:
        path = bundled_path(file)
        if path is None or (preset and file.preset != preset):
            continue
        digest = sha256_of(path) if path.is_file() else ""
        if not digest or (file.sha256 and digest != file.sha256):
            msg = f"{path}: the bundled weights of {name} are damaged; install the package anew"
            raise WeightsMismatch(msg)
        return Weights(path, "bundled", digest, file.name)
    return None


def sha256_of(path: Path, *more: Path) -> str:
    """Hexadecimal sha256 of a file, or of the names and contents of several.

    A folder counts as all files in it, those in sub-folders included.
    """
    digest = hashlib.sha256()
    if more or path.is_dir():
        named = {file.name: file for file in (path, *more)} if more else _files_in(path)
        for name, file in sorted(named.items()):
            digest.update(f"{name}\0{sha256_of(file)}\0".encode())
        return digest.hexdigest()
    with path.open("rb") as stream:
        while block := stream.read(1 << 20):
            digest.update(block)
    return digest.hexdigest()


def _files_in(folder: Path) -> dict[str, Path]:
    found = (path for path in folder.rglob("*") if path.is_file())
    return {path.relative_to(folder).as_posix(): path for path in found}


def _name_of(file: WeightsFile | None) -> str:
    return file.name if file else ""


def _how_to_get(name: str, card: Card) -> str:
    msg = f"no weights for {name}: pass them with --weights {name}=PATH (weights=PATH in Python)"
    msg += f", or register them once with nat-bench weights import {name} FILE"
    if card.weights:
        choices = "; or ".join(f"{file.name} from {file.where}" for file in card.weights)
        msg += f"; the official file is {choices}"
    registered = [describe_options(one.options) for one in list_registered(name)]
    if any(registered):
        msg += f"; registered are only those for {', and '.join(filter(None, registered))}"
    return msg
