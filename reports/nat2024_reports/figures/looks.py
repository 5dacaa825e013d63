"""How runs look in figures: one colour a tracker, solid with an enhancer and dashed without.

Where one tracker runs with several enhancers, each enhancer has its colour instead, and the tracker
alone is black and dashed. Several trackers with several enhancers are split into views, each of one
of these two kinds, so that no line needs more than a colour and a dash to be told.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from nat2024_reports.style import BLACK, COLOURS, plain_text, shortened

PLAIN = "none"
"""The enhancer of a tracker alone."""

DASHED = (0, (3.5, 1.4))
_MARKERS = ("", "o", "s", "^", "D", "v", "P", "X")
"""Colours are given out again with the next marker."""

SHAPES = ("o", "s", "^", "D", "v", "P", "X", "<", ">", "p", "h", "8", "d")
"""Of points, one an enhancer."""


@dataclass(frozen=True, slots=True)
class NamedRun:
    """One run as figures name it.

    Attributes:
        run: name of its folder, which tables carry.
        tracker: as readers know it, such as `SiamRPN++`.
        enhancer: likewise; `PLAIN` for the tracker alone.
        note: what sets it apart from the others, such as `3 of 4 sequences`; may be empty.
    """

    run: str
    tracker: str
    enhancer: str = PLAIN
    note: str = ""

    @property
    def is_plain(self) -> bool:
        """Whether it is a tracker alone."""
        return self.enhancer == PLAIN

    @property
    def label(self) -> str:
        """`SiamRPN++ + LDEnhancer`."""
        return self.tracker if self.is_plain else f"{self.tracker} + {self.enhancer}"


@dataclass(frozen=True, slots=True)
class Look:
    """How one run is drawn.

    Attributes:
        label: in legends, free of formulas and not too long.
        color: of lines, bars and points.
        is_dashed: whether it is a tracker alone beside others with an enhancer.
        marker: along lines, where colours had to be given out again; may be empty.
        shape: of a point.
    """

    label: str
    color: str
    is_dashed: bool
    marker: str
    shape: str

    @property
    def line(self) -> str | tuple[int, tuple[float, ...]]:
        """Line style as matplotlib takes it."""
        return DASHED if self.is_dashed else "-"


@dataclass(frozen=True, slots=True)
class View:
    """Runs that go into one figure.

    Attributes:
        name: empty where one view holds all runs; else what joins them, for names of files.
        words: the same for captions.
        runs: in their order.
        looks: by run.
        is_by_tracker: whether colours tell trackers, else enhancers.
    """

    name: str
    words: str
    runs: tuple[NamedRun, ...]
    looks: Mapping[str, Look]
    is_by_tracker: bool


def views_of(
    runs: Iterable[NamedRun], *, keep: Iterable[str] | None = None, trackers: bool = True
) -> list[View]:
    """Split runs so that each view is easy to read.

    With one enhancer (or none), or with one tracker, there is one view. Else there is one for each
    enhancer, with all trackers that ran with it, and one for each tracker, with all its enhancers.

    Args:
        runs: all runs of a dataset; colours follow their order, so they stay the same in all
            figures, whichever runs are kept.
        keep: names of the runs to draw, None for all.
        trackers: whether there are views of single trackers beside those of single enhancers.
    """
    every = tuple(runs)
    kept = tuple(run for run in every if keep is None or run.run in set(keep))
    enhancers, names = _enhancers(kept), _trackers(kept)
    if len(enhancers) <= 1:
        return [_view("", "", kept, every, by_tracker=True)] if kept else []
    if len(names) == 1:
        return [_view("", "", kept, every, by_tracker=False)]
    found = []
    for enhancer in enhancers:
        with_it = {run.tracker for run in kept if run.enhancer == enhancer}
        chosen = [r for r in kept if r.tracker in with_it and r.enhancer in (enhancer, PLAIN)]
        found.append(_view(f"with_{enhancer}", enhancer, chosen, every, by_tracker=True))
    for tracker in names if trackers else ():
        chosen = [run for run in kept if run.tracker == tracker]
        if _enhancers(chosen):
            found.append(_view(tracker, tracker, chosen, every, by_tracker=False))
    return found


def _view(
    name: str, words: str, runs: Iterable[NamedRun], every: Iterable[NamedRun], *, by_tracker: bool
) -> View:
    chosen = tuple(runs)
    looks = looks_of(chosen, every, by_tracker=by_tracker)
    return View(name, words, chosen, looks, by_tracker)


def looks_of(
    runs: Iterable[NamedRun], every: Iterable[NamedRun], *, by_tracker: bool
) -> dict[str, Look]:
    """How each run looks.

    Args:
        runs: to be drawn together.
        every: all runs of the dataset, whose order gives out the colours.
        by_tracker: whether colours tell trackers, else enhancers.
    """
    runs, every = tuple(runs), tuple(every)
    enhancers, trackers = _enhancers(every), _trackers(every)
    compared = bool(_enhancers(runs)) and any(run.is_plain for run in runs)
    looks = {}
    for run in runs:
        if by_tracker:
            color, marker = _colour(trackers.index(run.tracker))
        elif run.is_plain:
            color, marker = BLACK, ""
        else:
            color, marker = _colour(enhancers.index(run.enhancer))
        place = 0 if run.is_plain else 1 + enhancers.index(run.enhancer)
        looks[run.run] = Look(
            label=_legend_label(run),
            color=color,
            is_dashed=compared and run.is_plain,
            marker=marker,
            shape=SHAPES[place % len(SHAPES)],
        )
    return looks


def _legend_label(run: NamedRun) -> str:
    tracker = shortened(run.tracker, 40 if run.is_plain else 22)
    label = tracker if run.is_plain else f"{tracker} + {shortened(run.enhancer, 18)}"
    text = plain_text(f"{label} ({run.note})" if run.note else label)
    return f" {text}" if text.startswith("_") else text  # legends leave out what begins with _


def _colour(number: int) -> tuple[str, str]:
    turn, place = divmod(number, len(COLOURS))
    return COLOURS[place], _MARKERS[turn % len(_MARKERS)]


def _enhancers(runs: Iterable[NamedRun]) -> list[str]:
    return list(dict.fromkeys(run.enhancer for run in runs if not run.is_plain))


def _trackers(runs: Iterable[NamedRun]) -> list[str]:
    return list(dict.fromkeys(run.tracker for run in runs))
