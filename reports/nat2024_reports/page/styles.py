"""Which colour and which line each run has, the same in every table and curve of the page."""

from collections.abc import Sequence
from dataclasses import dataclass

from nat2024_reports.page.model import Run

COLORS = 8
"""Colours of the page's style sheet; more trackers begin again with the first."""

INK = COLORS
"""Number of the colour of text there: a tracker alone beside several enhancers."""

DASHES = 6
"""Lines of the page's style sheet: 0 is solid, 1 dashed, the others mixed."""

_PLAIN = "none"


@dataclass(frozen=True, slots=True)
class RunStyle:
    """Numbers of a colour and of a line in the page's style sheet."""

    color: int
    dash: int


def run_styles(runs: Sequence[Run]) -> list[RunStyle]:
    """One colour a tracker, solid with its first enhancer and dashed without, as in papers.

    A single tracker with several enhancers has one colour an enhancer instead, as its figures do.
    """
    trackers = list(dict.fromkeys(run.tracker for run in runs))
    enhancers = list(dict.fromkeys(run.enhancer for run in runs if run.enhancer != _PLAIN))
    styles = []
    for run in runs:
        number = enhancers.index(run.enhancer) if run.enhancer != _PLAIN else -1
        if len(trackers) == 1 and len(enhancers) > 1:
            turn, color = divmod(number, COLORS)
            line = min(turn + 1, DASHES - 1) if turn else 0
            styles.append(RunStyle(INK, 1) if number < 0 else RunStyle(color, line))
            continue
        is_compared = any(o.tracker == run.tracker and o.enhancer != _PLAIN for o in runs)
        line = number % (DASHES - 1)
        dash = int(is_compared) if number < 0 else 0 if line == 0 else line + 1
        styles.append(RunStyle(trackers.index(run.tracker) % COLORS, dash))
    return styles
