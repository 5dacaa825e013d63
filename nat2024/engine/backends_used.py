"""Which backends computed a sequence, where one failed its check and another took over."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from typing import Protocol, runtime_checkable

from nat2024.engine.plan import Combination
from nat2024.engine.timing import TimedEnhancer
from nat2024.engine.units import Outcome, Progress, Trackers, Unit, run_unit


@runtime_checkable
class HasBackends(Protocol):
    """A plugin that others than PyTorch may run.

    Attributes:
        backend: what it began with, as its options say.
    """

    backend: str

    @property
    def answered(self) -> Counter[str]:
        """How many calls each backend has answered so far."""
        ...


def run_and_note_backends(unit: Unit, trackers: Trackers, progress: Progress) -> Iterator[Outcome]:
    """`run_unit`, whose tracks tell of backends other than those that the manifest names.

    Where several sequences are on their way together, each tells what ran for any of them.
    """
    combinations = {one.run: one for one in unit.combinations}
    there = [one for one in unit.combinations if trackers.has(one)]
    before = {t: p.answered for one in there for t, p in _plugins(one, trackers).items()}
    for outcome in run_unit(unit, trackers, progress):
        if outcome.track is None:
            yield outcome
            continue
        other = {}
        for title, plugin in _plugins(combinations[outcome.run], trackers).items():
            used = plugin.answered - before.get(title, Counter())
            if used.keys() - {plugin.backend}:
                other[title] = tuple(sorted(used))
        yield replace(outcome, track=replace(outcome.track, other_backends=other))


def _plugins(combination: Combination, trackers: Trackers) -> dict[str, HasBackends]:
    """By `NAME[@LABEL]`, the plugins of a combination that have backends."""
    tracker = trackers.get(combination)
    plugins: dict[str, object] = {combination.tracker.title: tracker}
    if combination.enhancer and isinstance(tracker.enhancer, TimedEnhancer):
        plugins[combination.enhancer.title] = tracker.enhancer.enhancer
    return {title: plugin for title, plugin in plugins.items() if isinstance(plugin, HasBackends)}
