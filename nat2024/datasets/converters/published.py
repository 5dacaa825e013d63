"""The layout of UAVDark135, DarkTrack2021 and NAT: `data_seq/`, `anno/`, `att/`.

`anno/NAME.txt` has a row `x,y,w,h` a frame, `anno_keyframes/NAME.txt` rows `frame,x,y,w,h` with the
frame from 1 where only some are annotated, `att/NAME.txt` a row of 0 and 1 in the order of the
dataset's attributes (or as it came, where its columns have no names). A video lies as
`data_seq/NAME.mp4`. All else is in `nat-bench-extra.json`.
"""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from nat2024.boxes import format_boxes
from nat2024.datasets.annotations import read_box_file, read_keyframes
from nat2024.datasets.converters.common import (
    Described,
    below,
    ending,
    extra_file,
    find_extra,
    merge,
    numbered,
    read_extra,
)
from nat2024.datasets.frames import FolderFrames, StoredFrames
from nat2024.datasets.records import annotated_rows, boxes_of
from nat2024.datasets.schema import AnnotatedDataset, AnnotatedSequence, KeptSequence
from nat2024.datasets.video import VideoFrames

FORMAT = "published"
UNNAMED_FLAGS = "published.att"
"""Key of an attribute file whose columns nobody names, in `extra` of a sequence."""


def find(folder: Path) -> Path | None:
    """The side file in a folder of this layout."""
    return find_extra(folder, FORMAT)


def read(path: Path, base: Path) -> Described:
    """Read a folder of this layout with its side file."""
    found = read_extra(path)

    def native(sequence: KeptSequence) -> Mapping[str, Any]:
        if "keyframes" in sequence.native:
            file = base / "anno_keyframes" / f"{sequence.name}.txt"
            return annotated_rows(*read_keyframes(file, sequence.frames.count))
        return annotated_rows(read_box_file(base / "anno" / f"{sequence.name}.txt"), None)

    document = merge(found, str(base), native)
    frames = {s.name: _stored(base / "data_seq", s) for s in document.sequences}
    return Described(document, frames, base, f"data_seq/ + anno/ + {path.name}")


def _stored(folder: Path, sequence: AnnotatedSequence) -> StoredFrames:
    if sequence.frames.video:
        return VideoFrames(folder / _video_name(sequence), sequence.frames.count)
    return FolderFrames(folder / sequence.name, numbered(sequence))


def _video_name(sequence: AnnotatedSequence) -> str:
    return f"{sequence.name}{ending(sequence.frames.video)}"


def frame_paths(document: AnnotatedDataset) -> dict[str, tuple[str, ...]]:
    """`data_seq/NAME/` with the names that the frames have, `data_seq/NAME.mp4` for a video."""
    return {s.name: _paths(s) for s in document.sequences}


def _paths(sequence: AnnotatedSequence) -> tuple[str, ...]:
    if sequence.frames.video:
        return (f"data_seq/{_video_name(sequence)}",)
    return below(f"data_seq/{sequence.name}", numbered(sequence))


def files(document: AnnotatedDataset) -> Iterator[tuple[str, bytes]]:
    """Box files, attribute files, the side file last."""
    for sequence in document.sequences:
        if sequence.boxes is not None:
            yield _box_file(sequence)
        flags = sequence.extra.get(UNNAMED_FLAGS, "")
        if document.attributes:
            flags = ",".join(str(int(a in sequence.attributes)) for a in document.attribute_names)
        if flags:
            yield f"att/{sequence.name}.txt", f"{flags}\n".encode()
    yield extra_file(document, FORMAT, _native)


def _box_file(sequence: AnnotatedSequence) -> tuple[str, bytes]:
    text = format_boxes(boxes_of(sequence.boxes))
    if sequence.keyframes is None:
        return f"anno/{sequence.name}.txt", text.encode()
    numbers = (index + 1 for index in sequence.keyframes)
    rows = zip(numbers, text.splitlines(), strict=True)
    text = "".join(f"{number},{row}\n" for number, row in rows)
    return f"anno_keyframes/{sequence.name}.txt", text.encode()


def _native(sequence: AnnotatedSequence) -> tuple[str, ...]:
    if sequence.boxes is None:
        return ()
    return ("boxes",) if sequence.keyframes is None else ("boxes", "keyframes")
