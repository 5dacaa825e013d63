"""How far computed attributes agree with published ones, where both exist."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from nat2024.analysis.attributes import (
    ComputedAttributes,
    published_attributes,
    published_names,
)
from nat2024.types import Dataset


@dataclass(frozen=True, slots=True)
class Agreement:
    """Published and computed labels of one attribute over the sequences that have both.

    Attributes:
        attribute: its abbreviation.
        sequences: how many were compared.
        both: sequences that carry it either way.
        neither: sequences that carry it neither way.
        published_only: names of the sequences whose published label alone has it.
        computed_only: names of the sequences whose computed label alone has it.
    """

    attribute: str
    sequences: int
    both: int
    neither: int
    published_only: tuple[str, ...]
    computed_only: tuple[str, ...]

    @property
    def share(self) -> float:
        """Share of the sequences whose labels are equal."""
        return (self.both + self.neither) / self.sequences


def label_agreement(
    dataset: Dataset, computed: Mapping[str, ComputedAttributes]
) -> tuple[Agreement, ...]:
    """Compare published with computed labels, attribute by attribute in published order.

    Args:
        dataset: as loaded, with its published attributes and no computed ones.
        computed: by name of the sequence; sequences that are not in it are left out.

    Returns:
        One entry for each attribute that is both published and computed.
    """
    found = []
    for attribute in published_names(dataset):
        pairs = [
            (s.name, attribute in published_attributes(s), computed[s.name].labels[attribute])
            for s in dataset
            if s.name in computed and attribute in computed[s.name].labels
        ]
        if pairs:
            found.append(_compare(attribute, pairs))
    return tuple(found)


def _compare(attribute: str, pairs: Iterable[tuple[str, bool, bool]]) -> Agreement:
    pairs = tuple(pairs)
    return Agreement(
        attribute,
        len(pairs),
        sum(a and b for _, a, b in pairs),
        sum(not (a or b) for _, a, b in pairs),
        tuple(name for name, a, b in pairs if a and not b),
        tuple(name for name, a, b in pairs if b and not a),
    )
