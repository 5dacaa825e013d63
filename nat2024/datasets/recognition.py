"""Which registered dataset a folder holds, told by names and lengths of its sequences.

Names alone do not tell: NAT2021-test and NAT2021-L-test share 23 of them for different videos,
UAVDark70 and UAVDark135 share 62, most of them cut anew.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from nat2024.datasets.frames import count_frames
from nat2024.datasets.layouts import TRAINING_CLIPS, Layout
from nat2024.datasets.registered import DatasetFacts, list_datasets, registered_dataset
from nat2024.types import Dataset


@dataclass(frozen=True, slots=True)
class Candidate:
    """How much a folder has in common with one registered dataset.

    Attributes:
        name: registered name.
        shared: names that both have.
        equal: those of them that have the published length.
        published: sequences of the registered dataset.
    """

    name: str
    shared: int
    equal: int
    published: int


@dataclass(frozen=True, slots=True)
class Recognition:
    """What `recognise` found.

    Attributes:
        name: the registered dataset, or an empty text where none fits or two fit equally well.
        candidates: all registered datasets that share a name, the best first.
    """

    name: str
    candidates: tuple[Candidate, ...] = ()

    @property
    def facts(self) -> DatasetFacts | None:
        """Facts of the recognised dataset, None where there is none."""
        return registered_dataset(self.name) if self.name else None


def recognise(dataset: Dataset) -> Recognition:
    """Tell which registered dataset a loaded one is, whatever its folder is called."""
    if is_training_set(dataset.layout):
        return Recognition("nat2021_train")
    return recognise_lengths({s.name: len(s) for s in dataset.sequences})


def recognise_layout(layout: Layout) -> Recognition:
    """Tell which registered dataset a folder holds before any annotation is read."""
    if is_training_set(layout.words):
        return Recognition("nat2021_train")
    return recognise_lengths({s.name: count_frames(s.frames) for s in layout.sequences})


def is_training_set(words: str) -> bool:
    """Whether a layout is that of NAT2021-train, of which no names are published."""
    return words.lower().startswith(f"{TRAINING_CLIPS}/")


def recognise_lengths(lengths: Mapping[str, int]) -> Recognition:
    """Tell which registered dataset has sequences of these names and lengths.

    One fits when it agrees in name and length with at least half of the given sequences, or half
    of its own are there (the download of NAT2024-1 holds more than is reported). The one with the
    most agreements is taken, then the one with the fewest sequences of its own missing.
    """
    found = [_compare(name, lengths) for name in list_datasets()]
    ranked = sorted(
        (c for c in found if c.shared), key=lambda c: (-c.equal, c.published - c.equal, c.name)
    )
    fits = [c for c in ranked if c.equal and 2 * c.equal >= min(len(lengths), c.published)]
    tie = len(fits) > 1 and fits[0].equal == fits[1].equal
    complete = bool(fits) and fits[0].equal == fits[0].published
    name = fits[0].name if fits and (complete or not tie) else ""
    return Recognition(name, tuple(ranked))


def _compare(name: str, lengths: Mapping[str, int]) -> Candidate:
    published = registered_dataset(name).sequences
    shared = lengths.keys() & published.keys()
    equal = sum(lengths[s] in (published[s].frames, *published[s].other_frames) for s in shared)
    return Candidate(name, len(shared), equal, len(published))
