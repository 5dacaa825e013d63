"""What is drawn of one dataset: its runs as readers know them, and its tables, made once."""

import dataclasses
import functools
import re
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from nat2024.cli.display_names import display_names
from nat2024.errors import UsageError
from nat2024.evaluation import Evaluation
from nat2024.store import split_run_name
from nat2024.types import closest

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from nat2024.evidence import Evidence
    from nat2024.types import Dataset
    from nat2024_reports.figures.looks import NamedRun, View


@dataclass(frozen=True, slots=True)
class Drawing:
    """One figure with its numbers.

    Attributes:
        name: of its files, without ending.
        kind: as in `--kind`.
        dataset: what it is of.
        caption: as it could stand below the figure.
        figure: the figure.
        table: what is drawn, as its CSV file holds it.
    """

    name: str
    kind: str
    dataset: str
    caption: str
    figure: "Figure"
    table: "pd.DataFrame"


@dataclass(frozen=True, slots=True)
class Remark:
    """What a reader must know: something could not be drawn, or says less than it seems.

    Attributes:
        kind: as in `--kind`.
        text: what and why.
    """

    kind: str
    text: str


@dataclass(frozen=True)
class Wanted:
    """What is to be drawn; empty collections mean all.

    Attributes:
        trackers: `NAME[@LABEL]` of each.
        enhancers: likewise; trackers alone are always drawn beside them.
        attributes: attributes and categories.
        sequences: names, for figures of single sequences.
    """

    trackers: Collection[str] = ()
    enhancers: Collection[str] = ()
    attributes: Collection[str] = ()
    sequences: Collection[str] = ()


@dataclass(frozen=True)
class Job:
    """One dataset to be drawn.

    Attributes:
        evaluation: its scores.
        wanted: what to draw of it.
        dataset: gives its sequences, None where they are not at hand.
        gather: gives the evidence of an evaluation on sequences (None for all), None where the
            dataset is not at hand.
    """

    evaluation: Evaluation
    wanted: Wanted = field(default_factory=Wanted)
    dataset: "Callable[[], Dataset | None]" = lambda: None
    gather: "Callable[[Evaluation, Collection[str] | None], Evidence | None]" = lambda *_: None

    @property
    def name(self) -> str:
        """Of the dataset."""
        return self.evaluation.dataset

    @functools.cached_property
    def runs(self) -> "tuple[NamedRun, ...]":
        """All runs in their order, which gives out the colours."""
        from nat2024_reports.figures.looks import NamedRun

        runs = self.evaluation.runs
        trackers = display_names(dict.fromkeys(run.tracker for run in runs), "tracker")
        enhancers = display_names(dict.fromkeys(run.enhancer for run in runs), "enhancer")
        most = max((len(run.sequences) for run in runs), default=0)
        return tuple(
            NamedRun(
                run=run.run,
                tracker=trackers[run.tracker],
                enhancer=enhancers[run.enhancer],
                note=f"{len(run.sequences)}/{most} seq." if len(run.sequences) < most else "",
            )
            for run in runs
        )

    @functools.cached_property
    def keep(self) -> frozenset[str]:
        """Names of the runs to draw."""
        wanted = self.wanted
        return frozenset(
            run.run
            for run in self.evaluation.runs
            for tracker, enhancer in [split_run_name(run.run)]
            if (not wanted.trackers or tracker in wanted.trackers)
            and (not wanted.enhancers or enhancer in {"none", *wanted.enhancers})
        )

    @functools.cached_property
    def by_run(self) -> "dict[str, NamedRun]":
        """The runs to draw."""
        return {run.run: run for run in self.runs if run.run in self.keep}

    def views(self, *, trackers: bool = True) -> "list[View]":
        """The runs to draw, split as `views_of` does."""
        from nat2024_reports.figures.looks import views_of

        return views_of(self.runs, keep=self.keep, trackers=trackers)

    def over(self, sequences: Collection[str] | None = None) -> Evaluation:
        """The evaluation of the runs to draw, over all sequences or those named."""
        return _over(self.evaluation, self.keep, sequences)

    @functools.cached_property
    def summary(self) -> "pd.DataFrame":
        """`Evaluation.summary` of the runs to draw."""
        return self.over().summary()

    @functools.cached_property
    def gains(self) -> "Callable[..., pd.DataFrame]":
        """`Evaluation.gains` of the runs to draw, computed once for each `by`."""
        return functools.cache(self.over().gains)

    @functools.cached_property
    def evidence(self) -> "Callable[[tuple[str, ...] | None], Evidence | None]":
        """What tells why the runs to draw score so, on sequences or on all; gathered once."""
        return functools.cache(lambda names: self.gather(self.over(names), names))

    @functools.cached_property
    def groups(self) -> "dict[str, Group]":
        """Attributes, then categories, that are to be drawn."""
        evaluation = self.evaluation
        found = {
            name: Group(name, names, _provenance(evaluation, name, names))
            for name, names in evaluation.attributes.items()
        }
        for name, names in evaluation.categories.items():
            found.setdefault(name, Group(name, names, "", is_category=True))
        chosen = self.wanted.attributes
        return {name: group for name, group in found.items() if not chosen or name in chosen}

    def caption(self, words: str, count: int | None = None, *, after: str = "") -> str:
        """A caption that says of what, how many and by which protocol.

        Args:
            words: what is shown.
            count: of sequences; left out, the most that a run has.
            after: what is said last, a sentence.
        """
        count = int(self.summary.sequences.max()) if count is None else count
        unit = "sequence" if count == 1 else "sequences"
        protocol = self.evaluation.protocol.title
        caption = f"{words} on {self.name} ({count} {unit}, protocol {protocol})."
        return f"{caption} {after}." if after else caption

    def with_names(self, table: "pd.DataFrame") -> "pd.DataFrame":
        """A table with the names of tracker and enhancer beside each run."""
        table = table.drop(columns=["tracker", "enhancer"], errors="ignore")
        place = table.columns.get_loc("run")
        assert isinstance(place, int)
        named = table.copy()
        named.insert(place + 1, "tracker", [self.by_run[run].tracker for run in table.run])
        named.insert(place + 2, "enhancer", [self.by_run[run].enhancer for run in table.run])
        return named


@dataclass(frozen=True, slots=True)
class Group:
    """Sequences that share an attribute or a category.

    Attributes:
        name: abbreviation of the attribute, or the category.
        sequences: their names.
        provenance: of an attribute, as `Evaluation.per_attribute` gives it.
        is_category: whether it is a category of target.
    """

    name: str
    sequences: tuple[str, ...]
    provenance: str
    is_category: bool = False

    @property
    def is_computed(self) -> bool:
        """Whether it rests on computed attributes, not only on published ones."""
        return self.provenance in ("computed", "mixed")


def _provenance(evaluation: Evaluation, attribute: str, names: Iterable[str]) -> str:
    found = {evaluation.provenance.get(name, {}).get(attribute, "published") for name in names}
    return found.pop() if len(found) == 1 else "mixed"


def _over(
    evaluation: Evaluation, runs: Collection[str], sequences: Collection[str] | None
) -> Evaluation:
    """An evaluation of some runs over some sequences; runs without any of them are left out."""
    chosen = []
    for run in evaluation.runs:
        if run.run in runs:
            scores = {
                name: one
                for name, one in run.sequences.items()
                if sequences is None or name in sequences
            }
            if scores:
                chosen.append(dataclasses.replace(run, sequences=scores))
    return dataclasses.replace(evaluation, runs=tuple(chosen))


def check_wanted(wanted: Wanted, evaluations: Iterable[Evaluation]) -> None:
    """Refuse names that no evaluation knows.

    Raises:
        UsageError: such a name; names the closest.
    """
    known: Mapping[str, dict[str, None]] = {
        "--trackers": {},
        "--enhancers": {},
        "--attribute": {},
        "--sequence": {},
    }
    for evaluation in evaluations:
        known["--attribute"].update(dict.fromkeys([*evaluation.attributes, *evaluation.categories]))
        for run in evaluation.runs:
            tracker, enhancer = split_run_name(run.run)
            known["--trackers"][tracker] = known["--enhancers"][enhancer] = None
            known["--sequence"].update(dict.fromkeys([*run.sequences, *run.missing]))
    given = (wanted.trackers, wanted.enhancers, wanted.attributes, wanted.sequences)
    for (option, names), asked in zip(known.items(), given, strict=True):
        for name in asked:
            if name not in names:
                there = closest(name, names) or f"; there are {', '.join(list(names)[:12]) or '-'}"
                msg = f"{option} {name!r}: not in these results{there}"
                raise UsageError(msg)


def file_name(*parts: Any) -> str:
    """A plain name of a file out of names: `SiamAPN++` becomes `siamapnpp`."""
    words = [str(part).replace("++", "pp") for part in parts if str(part)]
    plain = [re.sub(r"[^A-Za-z0-9.-]+", "_", word).strip("._") for word in words]
    return "_".join(word for word in plain if word)[:120] or "figure"
