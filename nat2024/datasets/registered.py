"""What is published about each registered dataset: names, lengths, first boxes, attributes.

The facts are JSON files in `facts/`, one a dataset; a package adds its own through the entry
point group `nat_bench.datasets`, code at hand through `register_dataset`. Frames and ground truth
stay with their owners: `DatasetFacts.obtain` says where a person gets them.
"""

import functools
import importlib.metadata
import re
from fnmatch import fnmatchcase
from importlib.resources import files
from typing import TypeAlias

import msgspec

from nat2024.errors import BrokenPlugin, DatasetNotFound, DuplicatePlugin, InvalidOption
from nat2024.types import closest

FirstBox: TypeAlias = tuple[float, float, float, float]

_BUNDLED = (
    "darktrack2021",
    "nat2021_l_test",
    "nat2021_test",
    "nat2021_train",
    "nat2024_1",
    "nat2024_2",
    "night_mini",
    "uavdark135",
    "uavdark70",
)
_NAME = re.compile(r"[a-z0-9][a-z0-9_]*")
_GROUP = "nat_bench.datasets"


class SequenceFacts(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What is published about one sequence.

    Attributes:
        frames: number of images.
        first_box: x, y, w, h of the first frame in pixels, 0-based; None where no public list
            has it.
        first_frame: number in the name of the first image.
        other_frames: lengths that other public lists give.
    """

    frames: int
    first_box: FirstBox | None = None
    first_frame: int = 1
    other_frames: tuple[int, ...] = ()


class DatasetFacts(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """What is published about one dataset.

    Attributes:
        title: name as papers write it.
        paper: authors, title, venue and year.
        licence: licence of frames and ground truth.
        obtain: where a person gets them; nothing is downloaded by this package.
        expected_layout: what the folder must look like.
        folders: names of its folder under NAT2024_ROOT, the first one preferred.
        attribute_columns: abbreviations in the order of the columns of `att/NAME.txt`.
        attribute_note: how sure that order is.
        labels: attributes that are published apart, as names of the sequences that have them.
        reported_only: the download holds more sequences than papers report; only those in
            `sequences` are loaded unless asked otherwise.
        minimum_rows: the rule by which the official loader chooses among them: at least so many
            rows of annotation; 0 where there is no such rule.
        resolution: (width, height) in pixels where all sequences share it.
        frame_rate: frames a second, 0 where not published.
        frame_digits: digits in image names, 0 where not published.
        unchecked: what no public list has, in words.
        source: where the facts come from.
        sequences: facts of each sequence by name; empty where no list is published.
    """

    title: str
    paper: str = ""
    licence: str = ""
    obtain: str = ""
    expected_layout: str = ""
    folders: tuple[str, ...] = ()
    attribute_columns: tuple[str, ...] = ()
    attribute_note: str = ""
    labels: dict[str, tuple[str, ...]] = msgspec.field(default_factory=dict)
    reported_only: bool = False
    minimum_rows: int = 0
    resolution: tuple[int, int] | None = None
    frame_rate: float = 0.0
    frame_digits: int = 0
    unchecked: tuple[str, ...] = ()
    source: str = ""
    sequences: dict[str, SequenceFacts] = msgspec.field(default_factory=dict)

    @property
    def attributes(self) -> tuple[str, ...]:
        """All published attributes, those published apart last."""
        return (*self.attribute_columns, *self.labels)

    @property
    def summary(self) -> str:
        """One line: how many sequences and frames, which attributes."""
        if not self.sequences:
            return "no list of sequences is published"
        text = f"{len(self.sequences)} sequences, {self.frames} frames"
        return f"{text}, attributes {' '.join(self.attributes)}" if self.attributes else text

    @property
    def frames(self) -> int:
        """Frames of all sequences together."""
        return sum(sequence.frames for sequence in self.sequences.values())


_registered: dict[str, DatasetFacts] = {}


def list_datasets(pattern: str = "*") -> list[str]:
    """Sorted names of all registered datasets that match a shell pattern, plugins included."""
    return sorted(name for name in _names() if fnmatchcase(name, pattern))


def is_registered(name: str) -> bool:
    """Whether a dataset of that name is registered."""
    return name in _names()


def registered_dataset(name: str) -> DatasetFacts:
    """What is published about a registered dataset.

    Raises:
        DatasetNotFound: no dataset of that name is registered; names the closest.
        BrokenPlugin: a plugin's facts cannot be imported.
    """
    if name in _registered:
        return _registered[name]
    if name in _BUNDLED:
        return _read_bundled(name)
    point = _entry_points().get(name)
    if point is None:
        msg = (
            f"no dataset {name!r} is registered{closest(name.lower(), list_datasets())}; "
            "`nat-bench list` shows all"
        )
        raise DatasetNotFound(msg)
    return _load_plugin(name, point)


def register_dataset(name: str, facts: DatasetFacts, *, override: bool = False) -> None:
    """Register a dataset of one's own under `name` for this process.

    Raises:
        InvalidOption: the name has other than small letters, digits and underscores.
        DuplicatePlugin: the name is taken by other facts, unless `override`.
    """
    if not _NAME.fullmatch(name):
        msg = f"{name!r} is no dataset name: small letters, digits and underscores only"
        raise InvalidOption(msg)
    if is_registered(name) and not override and registered_dataset(name) != facts:
        msg = f"a dataset {name!r} is registered already ({registered_dataset(name).title})"
        raise DuplicatePlugin(msg)
    _registered[name] = facts


def _names() -> set[str]:
    return {*_BUNDLED, *_entry_points(), *_registered}


def _entry_points() -> dict[str, importlib.metadata.EntryPoint]:
    found: dict[str, importlib.metadata.EntryPoint] = {}
    for point in importlib.metadata.entry_points(group=_GROUP):
        other = found.get(point.name)
        taken = other.value if other else "nat-bench" if point.name in _BUNDLED else point.value
        if taken != point.value:
            msg = f"the dataset {point.name!r} is taken twice, by {taken} and {point.value}"
            raise DuplicatePlugin(msg)
        found[point.name] = point
    return found


def _load_plugin(name: str, point: importlib.metadata.EntryPoint) -> DatasetFacts:
    try:
        loaded = point.load()
    except Exception as error:  # a foreign plugin may fail in any way
        msg = f"dataset {name} ({point.value}) cannot be imported: {type(error).__name__}: {error}"
        raise BrokenPlugin(msg) from error
    if not isinstance(loaded, DatasetFacts):
        msg = f"dataset {name} ({point.value}) is no DatasetFacts"
        raise BrokenPlugin(msg)
    return loaded


@functools.cache
def _read_bundled(name: str) -> DatasetFacts:
    raw = files("nat2024.datasets").joinpath("facts", f"{name}.json").read_bytes()
    return msgspec.json.decode(raw, type=DatasetFacts)
