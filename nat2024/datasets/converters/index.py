"""Our own format: one index file that names the frames and holds everything else."""

from collections.abc import Iterator
from pathlib import Path

from nat2024.archives import is_stored
from nat2024.datasets.converters.common import Described, below
from nat2024.datasets.records import stored_frames
from nat2024.datasets.schema import INDEX_FILE, AnnotatedDataset, encode_dataset
from nat2024.datasets.schema_checks import read_dataset

FORMAT = "index"


def find(folder: Path) -> Path | None:
    """The index file in a folder."""
    path = folder / INDEX_FILE
    return path if is_stored(path) else None


def read(path: Path, base: Path) -> Described:
    """Read an index file whose frames lie below `base`."""
    document = read_dataset(path)
    frames = {s.name: stored_frames(base, s.frames) for s in document.sequences}
    return Described(document, frames, base, f"index {path.name} ({document.schema})")


def frame_paths(document: AnnotatedDataset) -> dict[str, tuple[str, ...]]:
    """Where the index says that its frames are."""
    return {s.name: _paths(s.frames.folder, s.frames.files()) for s in document.sequences}


def _paths(folder: str, names: tuple[str, ...]) -> tuple[str, ...]:
    return below(folder, names) if folder else names


def files(document: AnnotatedDataset) -> Iterator[tuple[str, bytes]]:
    """The index file."""
    yield INDEX_FILE, encode_dataset(document)
