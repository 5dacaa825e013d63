"""What `nat-bench train` prints alike of enhancers and of trackers."""

import math
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import click
import msgspec

from nat2024.cli.output import print_json, print_table
from nat2024.cli.progress import ProgressBar
from nat2024.errors import UsageError

if TYPE_CHECKING:
    from nat2024.training import TrainingReport


class Bars:
    """A progress bar for each part of the work."""

    def __init__(self) -> None:
        self._bar: ProgressBar | None = None

    def __enter__(self) -> "Bars":
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.__exit__()

    def begin(self, total: int) -> None:
        """The next part has so many things to do."""
        self.__exit__()
        self._bar = ProgressBar(total, "")

    def __call__(self, done: int, what: str) -> None:
        """Tell the bar."""
        if self._bar is not None:
            self._bar(done, what)


def print_settings(
    name: str,
    kind: str,
    preset: str,
    presets: Iterable[str],
    records: Iterable[msgspec.Struct],
    *,
    as_json: bool,
) -> None:
    """Print the settings that a plugin would be trained with.

    Args:
        name: of the plugin.
        kind: "enhancer" or "tracker".
        preset: that was chosen.
        presets: names of all.
        records: the settings.
        as_json: as one object.
    """
    settings = {key: value for one in records for key, value in msgspec.to_builtins(one).items()}
    if as_json:
        print_json({kind: name, "preset": preset, "presets": list(presets), "settings": settings})
        return
    rows = [[key, _text_of(value)] for key, value in settings.items()]
    print_table(
        ["Setting", "Value"], rows, title=f"{name}, preset {preset} (of {', '.join(presets)})"
    )


def _text_of(value: Any) -> str:
    """As `--set` takes it."""
    if isinstance(value, list | tuple):
        return ",".join(map(str, value))
    return str(value).lower() if isinstance(value, bool) else str(value)


def print_loop(loop: "TrainingReport", material: str) -> None:
    """Print how far a training came on what material, why it stopped, and its last losses."""
    done = f"{loop.steps} of {loop.wanted} steps on {material}"
    if loop.resumed_from:
        done += f", {loop.resumed_from} of them before"
    click.echo(f"{done}, {loop.seconds:.0f} s")
    if loop.stopped == "minutes":
        click.echo("stopped for its time; the same command goes on")
    elif loop.stopped == "patience":
        click.echo("stopped since the validation got no better")
    if loop.best_step is not None:
        click.echo(f"weights of step {loop.best_step}, the best of the validation")
    rows = [[name, f"{value:.4g}"] for name, value in loop.terms.items()]
    if rows:
        print_table(["Last losses", "mean"], rows)


def show_number(value: float, form: str = ".4f") -> str:
    """The number, or "-" where there is none, as of bright pixels in pictures without any."""
    return "-" if math.isnan(value) else format(value, form)


def check_options(name: str, kind: str, others: Mapping[str, object]) -> None:
    """Refuse options of the other kind of plugin.

    Args:
        name: of the plugin.
        kind: "enhancer" or "tracker".
        others: options that are not of this kind, with what was given.

    Raises:
        UsageError: one was given.
    """
    given = [option for option, value in others.items() if value]
    if given:
        other = "trackers" if kind == "enhancer" else "enhancers"
        msg = f"{name} is an {kind}" if kind == "enhancer" else f"{name} is a {kind}"
        msg += f"; {', '.join(given)} {'is' if len(given) == 1 else 'are'} for training {other}"
        raise UsageError(msg)
