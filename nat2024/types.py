"""The nouns of the project: boxes, frames, sequences and datasets.

Conventions, everywhere:

* a box is float64 `x, y, w, h` in pixels, `x, y` the top-left corner, 0-based;
* an image is uint8 of shape (height, width, 3), C-contiguous, in BGR order as OpenCV reads it,
  unless a name says otherwise, and is never modified in place;
* frame numbers in code are 0-based.
"""

import difflib
import hashlib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Protocol, TypeAlias

import numpy as np
import numpy.typing as npt

from nat2024.errors import UnknownSequence

Image: TypeAlias = npt.NDArray[np.uint8]
"""uint8 (height, width, 3)."""

Box: TypeAlias = npt.NDArray[np.float64]
"""float64 (4,): x, y, w, h."""

Boxes: TypeAlias = npt.NDArray[np.float64]
"""float64 (n, 4): one box a frame."""

Floats: TypeAlias = npt.NDArray[np.float64]
Flags: TypeAlias = npt.NDArray[np.bool_]


class FrameSource(Protocol):
    """Frames that are decoded only when asked for."""

    @property
    def frame_size(self) -> tuple[int, int]:
        """(width, height) of the first frame in pixels."""
        ...

    def __len__(self) -> int:
        """Number of frames."""
        ...

    def __getitem__(self, index: int, /) -> Image:
        """Frame `index`, uint8 (H, W, 3) BGR; `FrameUnreadable` where it cannot be decoded."""
        ...


@dataclass(frozen=True, slots=True)
class Sequence:
    """One video with the box of one target.

    Attributes:
        name: unique inside its dataset only: NAT2021-test and NAT2021-L-test share names.
        frames: lazy frame source.
        boxes: float64 (n, 4), exactly as stored: zero-size rows stay, absent rows are NaN;
            (0, 4) where the sequence has no annotation.
        visible: bool (n,) where the dataset publishes such flags, else None.
        attributes: abbreviations such as `FM`, `LR`, `IV`.
        keyframes: indices of the annotated frames where only some are (rows of all other frames
            are NaN and mean "not annotated"), else None.
        category: what the target is, such as `car`; empty where nothing tells.
        activity: what the target does, such as `cycling`; empty where nothing tells.
        provenance: where an attribute comes from, `published`, `computed` or `manual`, by its
            abbreviation; those without an entry are published.
    """

    name: str
    frames: FrameSource
    boxes: Boxes
    visible: Flags | None = None
    attributes: frozenset[str] = frozenset()
    keyframes: npt.NDArray[np.intp] | None = None
    category: str = ""
    activity: str = ""
    provenance: Mapping[str, str] = field(default_factory=dict)

    def __len__(self) -> int:
        """Number of frames."""
        return len(self.frames)

    def image(self, index: int) -> Image:
        """Frame `index` (0-based), uint8 (H, W, 3) BGR."""
        return self.frames[index]

    @property
    def frame_size(self) -> tuple[int, int]:
        """(width, height) in pixels."""
        return self.frames.frame_size

    def start_digest(self) -> str:
        """Tells what a tracker is given: equal for equal length and first box."""
        first = np.ascontiguousarray(self.boxes[:1]).tobytes()
        return hashlib.sha256(f"{len(self)}\0".encode() + first).hexdigest()[:16]

    @property
    def is_annotated(self) -> bool:
        """Whether every frame has a row of ground truth."""
        return len(self.boxes) > 0 and self.keyframes is None


@dataclass(frozen=True, slots=True)
class Origin:
    """How a dataset was loaded, so that it can be loaded again from anywhere.

    Attributes:
        source: registered name, or absolute path.
        root: absolute path of the root that was given, else empty.
        lenient: whether boxes and frames of unequal number were cut.
        rule: which sequences belong to it, as given.
    """

    source: str
    root: str = ""
    lenient: bool = False
    rule: str | None = None


@dataclass(frozen=True, slots=True)
class Dataset:
    """Named sequences that are tracked and scored together.

    Attributes:
        name: registered name, or the base name of the folder.
        sequences: sorted by name.
        root: folder it was read from, if any.
        layout: the recognised folder layout in words.
        unannotated: names left out because not every frame has a box.
        attribute_names: abbreviations in published order.
        origin: how it was loaded, None where it was put together in code.
    """

    name: str
    sequences: tuple[Sequence, ...]
    root: Path | None = None
    layout: str = ""
    unannotated: tuple[str, ...] = ()
    attribute_names: tuple[str, ...] = ()
    origin: Origin | None = None
    _by_name: dict[str, Sequence] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_by_name", {s.name: s for s in self.sequences})

    def __len__(self) -> int:
        """Number of sequences."""
        return len(self.sequences)

    def __iter__(self) -> Iterator[Sequence]:
        """Sequences in sorted order of their names."""
        return iter(self.sequences)

    def __contains__(self, name: object) -> bool:
        """Whether a sequence of that name is there."""
        return name in self._by_name

    def __getitem__(self, name: str) -> Sequence:
        """The sequence of that name; `UnknownSequence` names the closest ones."""
        try:
            return self._by_name[name]
        except KeyError:
            close = closest(name, self._by_name) if isinstance(name, str) else "; pass a name"
            msg = f"dataset {self.name} has no sequence {name!r}{close}"
            raise UnknownSequence(msg) from None

    def select(self, names: Iterable[str]) -> "Dataset":
        """The same dataset with only these sequences, in dataset order."""
        wanted = {self[name].name for name in names}
        return replace(self, sequences=tuple(s for s in self.sequences if s.name in wanted))


def closest(name: str, known: Iterable[str], count: int = 3) -> str:
    """`"; closest: a, b, c"`, or an empty text where nothing is near."""
    near = difflib.get_close_matches(name, list(known), n=count, cutoff=0.4)
    return f"; closest: {', '.join(near)}" if near else ""
