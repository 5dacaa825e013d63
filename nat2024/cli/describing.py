"""What the verbs that compute attributes share: options of the rules, and a bar of frames."""

import contextlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import click

from nat2024.cli.options import read_pairs

if TYPE_CHECKING:
    from nat2024.analysis import AttributeRules
    from nat2024.types import Dataset

EVERY = 10
"""Pixels are looked at in every 10th frame, unless told otherwise."""

rules_option = click.option(
    "--rules",
    default="uav123",
    show_default=True,
    metavar="NAME",
    help="Rules of computed attributes: uav123, lasot, uavdark135.",
)
rule_options_option = click.option(
    "--rule-option",
    "rule_options",
    multiple=True,
    metavar="KEY=VALUE",
    help="A threshold of the rules, such as low_area=1000; repeatable.",
)
columns_option = click.option(
    "--columns",
    metavar="NAMES",
    help="Columns of the attribute files, such as SV,ARC,LR, or as in uav123, uavdt, dtb70, lasot.",
)
every_option = click.option(
    "--every",
    type=click.IntRange(1),
    default=EVERY,
    show_default=True,
    metavar="N",
    help="Look at the pixels of every Nth frame.",
)


def choose_rules(name: str, texts: tuple[str, ...]) -> "AttributeRules":
    """The rules of `--rules` and `--rule-option`.

    Raises:
        UsageError, InvalidOption: no such rules or threshold, or no number of its kind.
    """
    from nat2024.analysis import get_rules

    return get_rules(name, read_pairs(texts, "--rule-option"))


def load(name_or_path: str, root: Path | None, columns: str | None, *, lenient: bool) -> "Dataset":
    """Load a dataset, sequences without annotation included, with its published attributes.

    Raises:
        NatBenchError: as `load_dataset`, `attribute_columns` and `with_attribute_files`.
    """
    from nat2024.datasets import attribute_columns, load_dataset, with_attribute_files

    names = attribute_columns(columns) if columns is not None else None
    dataset = load_dataset(name_or_path, root, unannotated=True, lenient=lenient)
    return dataset if names is None else with_attribute_files(dataset, names)


@contextlib.contextmanager
def frame_bar(dataset: "Dataset", every: int) -> Iterator[Callable[[], object]]:
    """A bar on standard error, where that is a terminal; gives what to call after each frame.

    Args:
        dataset: whose frames are looked at.
        every: distance of these frames, 0 for none.
    """
    from tqdm import tqdm

    total = sum(-(-len(sequence) // every) for sequence in dataset) if every else 0
    with tqdm(total=total, unit="frame", disable=None if total else True) as bar:
        yield bar.update
