"""The table of formats that results are exported to."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

from nat2024.exporting import bundle, got10k, own, pysot, pytracking
from nat2024.exporting.taking import TakenRun
from nat2024.store import DatasetRecord

Write: TypeAlias = Callable[[Sequence[TakenRun], DatasetRecord, Path], dict[str, Path]]
"""Writes runs of one dataset under a folder; gives by run what it was written to."""


@dataclass(frozen=True, slots=True)
class Format:
    """One form of stored results.

    Attributes:
        words: the layout under the folder that is written to.
        loses: what it cannot keep, in words; empty where it keeps every number.
        write: writes it.
        refuse: why the boxes of a sequence cannot be written in it, or an empty text.
    """

    words: str
    write: Write
    loses: str = ""
    refuse: "Callable[..., str] | None" = None


FORMATS: dict[str, Format] = {
    "pysot": Format(pysot.WORDS, pysot.write, pysot.LOSES),
    "got10k": Format(got10k.WORDS, got10k.write, got10k.LOSES),
    "pytracking": Format(
        pytracking.WORDS, pytracking.write, pytracking.LOSES, pytracking.why_refused
    ),
    "bundle": Format(bundle.WORDS, bundle.write),
    "nat-bench": Format(own.WORDS, own.write, own.LOSES),
}
