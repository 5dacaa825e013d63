"""`nat-bench train` for trackers: what `nat2024.tracker_training` does, in words."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import msgspec

from nat2024.cli.output import print_json, print_table
from nat2024.cli.progress import ProgressBar
from nat2024.errors import NatBenchError, UsageError

if TYPE_CHECKING:
    from nat2024.tracker_training import TrackerTraining, TrackerTrainingReport


def show_settings(name: str, preset: str, values: Mapping[str, Any], *, as_json: bool) -> int:
    """Print the settings that a tracker would be trained with."""
    from nat2024.tracker_training import choose_settings

    records = choose_settings(name, preset, values)
    settings = {key: value for one in records for key, value in msgspec.to_builtins(one).items()}
    if as_json:
        print_json({"tracker": name, "preset": preset, "settings": settings})
        return 0
    rows = [[key, str(value)] for key, value in settings.items()]
    print_table(["Setting", "Value"], rows, title=f"{name}, preset {preset}")
    return 0


def training_of(
    name: str,
    preset: str,
    values: Mapping[str, Any],
    data: str,
    photographs: Path | None,
    **more: Any,
) -> "TrackerTraining":
    """What the words of a call ask for.

    Args:
        name: the tracker.
        preset: of its settings.
        values: settings that differ from it.
        data: a dataset with boxes, or a folder of photographs.
        photographs: a folder of photographs beside it.
        more: other fields of `TrackerTraining`.

    Raises:
        UsageError: `data` has no boxes, and `photographs` is named besides.
    """
    from nat2024.tracker_training import TrackerTraining, choose_settings

    loop, own = choose_settings(name, preset, values)
    sequences = data if _has_boxes(data, more.get("root")) else ""
    if not sequences and photographs is not None:
        msg = f"--data {data} has no boxes; where it is a folder of photographs leave the other out"
        raise UsageError(msg)
    pictures = photographs if sequences else Path(data)
    return TrackerTraining(
        name, photographs=pictures, sequences=sequences, loop=loop, own=own, **more
    )


def _has_boxes(data: str, root: Path | None) -> bool:
    from nat2024.datasets import load_dataset

    try:
        return any(len(sequence.boxes) for sequence in load_dataset(data, root, unannotated=True))
    except NatBenchError:
        if Path(data).is_dir():
            return False
        raise


def run(training: "TrackerTraining", minutes: float | None, *, as_json: bool) -> int:
    """Train, and say what came of it."""
    from nat2024.tracker_training import train_tracker

    loop = training.loop
    with ProgressBar(loop.steps, f"training {training.name}") as progress:
        report = train_tracker(training, minutes=minutes, on_progress=progress)
    if as_json:
        print_json({"training": report})
    else:
        _print(report)
    return 0


def _print(report: "TrackerTrainingReport") -> None:
    loop = report.training
    material = f"{report.photographs} photographs and {report.clips} sequences"
    click.echo(f"{loop.steps} of {loop.wanted} steps on {material}, {loop.seconds:.0f} s")
    if loop.stopped == "minutes":
        click.echo("stopped for its time; the same command goes on")
    if loop.terms:
        rows = [[name, f"{value:.4g}"] for name, value in loop.terms.items()]
        print_table(["Last losses", "mean"], rows)
    if loop.numbers:
        print_table(["New pairs", "overlap", "found", "size slope", "size bias"], _rows(loop))
    click.echo(f"weights: {report.weights}")


def _rows(loop: Any) -> list[list[str]]:
    """A row for each generator; other numbers of a validation have a row of their own."""
    kinds = [name.removesuffix("_slope") for name in loop.numbers if name.endswith("_slope")]
    names = ("overlap", "found", "slope", "bias")
    rows = [[kind, *(f"{loop.numbers[f'{kind}_{name}']:.3f}" for name in names)] for kind in kinds]
    used = {f"{kind}_{name}" for kind in kinds for name in names}
    rest = {name: value for name, value in loop.numbers.items() if name not in used}
    return rows + [[name, f"{value:.3f}", "", "", ""] for name, value in rest.items()]
