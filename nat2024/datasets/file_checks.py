"""Files of a sequence that must not be used: links that lead out, two images of one number."""

from collections.abc import Iterator
from pathlib import Path

from nat2024.datasets.frameless import AbsentFrames
from nat2024.datasets.frames import same_number
from nat2024.datasets.layouts import FoundSequence
from nat2024.errors import DatasetIncomplete


def base_folder(place: Path) -> Path:
    """The folder that the files of a dataset must lie in: its own, or that of its archive."""
    return place.parent if place.is_file() else place


def check_files(found: FoundSequence, root: Path) -> None:
    """Refuse what listing the files of a sequence has shown to be wrong.

    A folder may itself be a link, as people lay out large disks. A file that is a link must lead
    to a place below `root`, or below the folder in which it lies once that is followed.

    Raises:
        DatasetIncomplete: there are no frames, a file is a link that leads out, or two images have
            one number; names them.
    """
    if not found.frames and not isinstance(found.frames, AbsentFrames):
        msg = f"{found.name}: no images in {found.frames.folder}"
        raise DatasetIncomplete(msg)
    for path in _links(found):
        target = path.resolve()
        if target.exists() and not target.is_file():
            msg = f"{found.name}: {path} is no file but a device or pipe; remove it"
            raise DatasetIncomplete(msg)
        if not any(target.is_relative_to(x.resolve()) for x in (root, path.parent)):
            msg = (
                f"{found.name}: {path} is a link out of the dataset folder, to {target}; "
                "put the file itself there"
            )
            raise DatasetIncomplete(msg)
    twice = same_number(found.frames.names)
    if twice:
        msg = (
            f"{found.name}: images {twice[0]} and {twice[1]} in {found.frames.folder} have the "
            "same number; remove one of them"
        )
        raise DatasetIncomplete(msg)


def _links(found: FoundSequence) -> Iterator[Path]:
    yield from (found.frames.folder / name for name in found.links)
    for path in (found.boxes, found.keyframes, found.attributes):
        if path is not None and path.is_symlink():
            yield path
    yield from (p for p in map(found.folder.joinpath, found.side_files) if p.is_symlink())
