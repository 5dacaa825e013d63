"""`nat-bench train` for trackers: what `nat2024.tracker_training` does, in words."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from nat2024.cli.output import print_json, print_table
from nat2024.cli.training_report import Bars, print_loop, print_settings
from nat2024.errors import NatBenchError, UsageError

if TYPE_CHECKING:
    from nat2024.tracker_training import TrackerTraining, TrackerTrainingReport


def show_settings(name: str, preset: str, values: Mapping[str, Any], *, as_json: bool) -> int:
    """Print the settings that a tracker would be trained with."""
    from nat2024.tracker_training import choose_settings, list_presets

    records = choose_settings(name, preset, values)
    print_settings(name, "tracker", preset, list_presets(name), records, as_json=as_json)
    return 0


def training_of(
    name: str,
    preset: str,
    values: Mapping[str, Any],
    data: str | None,
    photographs: Path | None,
    **more: Any,
) -> "TrackerTraining":
    """What the words of a call ask for.

    Args:
        name: the tracker.
        preset: of its settings.
        values: settings that differ from it.
        data: a dataset with boxes, or a folder of photographs; None where those are named.
        photographs: a folder of photographs, beside a dataset or alone.
        more: other fields of `TrackerTraining`.

    Raises:
        UsageError: nothing is named, or `data` has no boxes and `photographs` is named besides.
    """
    from nat2024.tracker_training import TrackerTraining, choose_settings

    loop, own = choose_settings(name, preset, values)
    if data is None:
        if photographs is None:
            msg = "--data is missing: a dataset with boxes, or a folder of photographs"
            raise UsageError(msg)
        return TrackerTraining(name, photographs=photographs, loop=loop, own=own, **more)
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

    with Bars() as bars:
        report = train_tracker(training, minutes=minutes, on_progress=bars, on_total=bars.begin)
    if as_json:
        print_json({"training": report})
    else:
        _print(report)
    return 0


def _print(report: "TrackerTrainingReport") -> None:
    loop = report.training
    material = f"{report.photographs} photographs and {report.clips} sequences"
    print_loop(loop, material)
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
