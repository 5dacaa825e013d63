"""Looks of runs in pictures."""

from nat2024.cli.showing.scenes import looks_of_runs
from nat2024_reports.figures.looks import NamedRun, looks_of
from nat2024_reports.style import COLOURS


def test_colours_are_those_of_the_other_figures() -> None:
    every = [NamedRun(f"{t}{e}", t, e or "none") for t in "abcd" for e in ("", "+x")]
    shown = every[4:]
    figures = looks_of(every, every, by_tracker=True)
    found = looks_of_runs(shown, every)
    assert {run: look.color for run, look in found.items()} == {
        run.run: figures[run.run].color for run in shown
    }


def test_no_two_trackers_share_a_colour() -> None:
    every = [NamedRun(str(n), str(n)) for n in range(len(COLOURS) + 1)]
    first, last = looks_of_runs([every[0], every[-1]], every).values()
    assert first.color != last.color
