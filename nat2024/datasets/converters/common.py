"""What the foreign formats share: the side file with what a format has no field for."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

import msgspec

from nat2024.archives import is_stored
from nat2024.datasets.frames import StoredFrames
from nat2024.datasets.records import replace_fields
from nat2024.datasets.schema import (
    AnnotatedDataset,
    AnnotatedSequence,
    KeptDataset,
    KeptSequence,
    decode_kept,
    encode_dataset,
    read_bytes,
)
from nat2024.datasets.schema_checks import check_dataset
from nat2024.errors import AnnotationInvalid

EXTRA_FILE = "nat-bench-extra.json"

_FIELDS = tuple(field.name for field in msgspec.structs.fields(AnnotatedSequence))
_HEAD = tuple(f.name for f in msgspec.structs.fields(AnnotatedDataset) if f.name != "sequences")


@dataclass(frozen=True, slots=True)
class Described:
    """A dataset that was read from annotation files.

    Attributes:
        document: the annotation; `frames` of a sequence are those of the index that it once was,
            where the format renames files.
        frames: where the images of each sequence are meant to lie now.
        base: folder that everything lies in.
        words: the format in words.
        remarks: what could not be kept, one line each.
    """

    document: AnnotatedDataset
    frames: Mapping[str, StoredFrames]
    base: Path
    words: str
    remarks: tuple[str, ...] = field(default=())


class Converter(Protocol):
    """One format, as a module."""

    FORMAT: str
    """Name of the format."""

    def find(self, folder: Path) -> Path | None:
        """The file in `folder` by which the format is known; None where it is another format."""
        ...

    def read(self, path: Path, base: Path) -> Described:
        """Read the dataset whose file `find` gave; frames lie below `base`."""
        ...

    def frame_paths(self, document: AnnotatedDataset) -> dict[str, tuple[str, ...]]:
        """Where the frames of each sequence go, as paths from the output folder."""
        ...

    def files(self, document: AnnotatedDataset) -> Iterable[tuple[str, bytes]]:
        """The annotation files as paths from the output folder, with what is in them."""
        ...


Native = Callable[[AnnotatedSequence], Iterable[str]]
ReadNative = Callable[[KeptSequence], Mapping[str, Any]]


def kept(document: AnnotatedDataset, name: str, native: Native) -> KeptDataset:
    """What the format `name` does not hold of a dataset.

    Args:
        document: the dataset.
        name: of the format.
        native: which fields of a sequence the format holds without loss.
    """
    sequences = [_kept_sequence(s, tuple(native(s))) for s in document.sequences]
    head = {key: getattr(document, key) for key in _HEAD}
    return KeptDataset(**head, format=name, sequences=tuple(sequences))


def _kept_sequence(sequence: AnnotatedSequence, native: tuple[str, ...]) -> KeptSequence:
    values = {name: getattr(sequence, name) for name in _FIELDS if name not in native}
    return KeptSequence(**values, native=native)


def extra_file(document: AnnotatedDataset, name: str, native: Native) -> tuple[str, bytes]:
    """The side file of a format; see `kept`."""
    return EXTRA_FILE, encode_dataset(kept(document, name, native))


def find_extra(folder: Path, name: str) -> Path | None:
    """The side file in `folder`, if it is one of the format `name`."""
    path = folder / EXTRA_FILE
    return path if is_stored(path) and _format_of(path) == name else None


class _Format(msgspec.Struct):
    format: str = ""


def _format_of(path: Path) -> str:
    try:
        return msgspec.json.decode(read_bytes(path), type=_Format).format
    except (ValueError, RecursionError) as error:  # no UTF-8 and endless nesting too
        msg = f"{path}: no valid JSON ({error})"
        raise AnnotationInvalid(msg) from None


def read_extra(path: Path) -> KeptDataset:
    """Read and check a side file.

    Raises:
        AnnotationInvalid: see `nat2024.datasets.schema.decode_dataset`.
    """
    return check_dataset(decode_kept(read_bytes(path), str(path)), str(path), complete=False)


def merge(found: KeptDataset, where: str, read_native: ReadNative) -> AnnotatedDataset:
    """The whole dataset: what was kept, and what the format's own files hold.

    Args:
        found: from the side file.
        where: named in errors.
        read_native: the native fields of a sequence.

    Raises:
        AnnotationInvalid: they do not fit together.
    """
    sequences = tuple(replace_fields(s, _wanted(s, read_native)) for s in found.sequences)
    head = {key: getattr(found, key) for key in _HEAD}
    return check_dataset(AnnotatedDataset(**head, sequences=sequences), where)


def _wanted(sequence: KeptSequence, read_native: ReadNative) -> dict[str, Any]:
    if not sequence.native:
        return {}
    values = read_native(sequence)
    return {name: values[name] for name in sequence.native if name in values}


def ending(name: str) -> str:
    """The ending of a file name with its dot, such as `.jpg`."""
    return name[name.rfind(".") :] if "." in name else ""


def numbered(sequence: AnnotatedSequence) -> tuple[str, ...]:
    """File names in frame order, renamed to `00000001.jpg` where their own order is another.

    Tools that read a folder sort its names as text: `2.jpg` would come after `10.jpg`.
    """
    names = sequence.frames.files()
    if list(names) == sorted(names) and len({ending(name) for name in names}) == 1:
        return names
    return renamed(names)


def renamed(names: tuple[str, ...]) -> tuple[str, ...]:
    """`00000001.jpg` and so on, with the endings of `names`."""
    return tuple(f"{i:08d}{ending(name)}" for i, name in enumerate(names, 1))


def below(folder: str, names: Iterable[str]) -> tuple[str, ...]:
    """Paths of files in a folder."""
    return tuple(f"{folder}/{name}" for name in names)


def lines(values: Iterable[object]) -> bytes:
    """One value a line."""
    return "".join(f"{value}\n" for value in values).encode()


def iterate_once(files: Iterable[tuple[str, bytes]]) -> Iterator[tuple[str, bytes]]:
    """The files, each path once.

    Raises:
        AnnotationInvalid: two files would have one path, in any case of letters.
    """
    seen: set[str] = set()
    for path, data in files:
        if path.lower() in seen:
            msg = f"two files would be called {path}; rename a sequence"
            raise AnnotationInvalid(msg)
        seen.add(path.lower())
        yield path, data
