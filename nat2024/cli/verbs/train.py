"""`nat-bench train`: train an enhancer on pictures, or all variants of its ablation."""

import logging
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from nat2024.cli import options as shared
from nat2024.cli import training_trackers
from nat2024.cli.output import print_json, print_table
from nat2024.cli.training_report import Bars, check_options, print_loop, print_settings, show_number
from nat2024.errors import UsageError
from nat2024.registry import plugin_kind

if TYPE_CHECKING:
    from nat2024.enhancing.training import (
        EnhancerTraining,
        EnhancerTrainingReport,
        Spread,
        Tracking,
        Variant,
    )

log = logging.getLogger("nat2024")

_SHOWN = ("dark_lift", "mean_after", "saturated_after", "over_enhanced", "success", "success_gain")


@click.command()
@click.argument("name")
@click.option(
    "--data",
    metavar="NAME_OR_PATH",
    help="A folder of images, a video, or a dataset, of which every 50th frame is taken; "
    "for a tracker a dataset with boxes, or a folder of photographs.",
)
@click.option(
    "--photographs",
    type=click.Path(path_type=Path, file_okay=False),
    help="For a tracker: images that objects are cut from, beside or without --data.",
)
@shared.root_option
@click.option(
    "--out",
    type=click.Path(path_type=Path, file_okay=False),
    help="Folder of the training (default: training/NAME).",
)
@click.option(
    "--preset", default="default", show_default=True, help="Settings to begin with; see --settings."
)
@click.option("--set", "values", multiple=True, metavar="KEY=VALUE", help="A setting; repeatable.")
@click.option("--settings", "only_settings", is_flag=True, help="Print presets and settings, stop.")
@click.option(
    "--opt", "opts", multiple=True, metavar="KEY=VALUE", help="Option of the plugin; repeatable."
)
@click.option("--steps", type=click.IntRange(1), help="Steps; the same as --set steps=N.")
@click.option("--minutes", type=click.FloatRange(0), help="Stop after so long, to go on later.")
@click.option("--seed", type=click.IntRange(0), help="The same as --set seed=N.")
@click.option(
    "--from",
    "start",
    type=click.Path(path_type=Path, dir_okay=False),
    help="Start from a checkpoint instead of fresh weights.",
)
@click.option(
    "--cache",
    type=click.Path(path_type=Path, file_okay=False),
    help="Folder for pictures with their labels (default: .nat-bench in the data's folder).",
)
@click.option("--validate-sequences", metavar="NAME_OR_PATH", help="Dataset to track on, held out.")
@click.option(
    "--validate-tracker",
    "trackers",
    multiple=True,
    metavar="NAME",
    help="With what; repeatable (default: fdsst).",
)
@click.option("--best", help="Number of the validation that chooses the step, such as success.")
@click.option("--ablation", is_flag=True, help="Train all variants with equal budgets.")
@click.option(
    "--seeds",
    type=click.IntRange(1),
    default=3,
    show_default=True,
    help="Trainings of each variant.",
)
@shared.device_option
@shared.plugin_option
@shared.json_option
@shared.messages
def command(
    name: str,
    data: str | None,
    photographs: Path | None,
    root: Path | None,
    out: Path | None,
    preset: str,
    values: tuple[str, ...],
    only_settings: bool,
    opts: tuple[str, ...],
    steps: int | None,
    minutes: float | None,
    seed: int | None,
    start: Path | None,
    cache: Path | None,
    validate_sequences: str | None,
    trackers: tuple[str, ...],
    best: str | None,
    ablation: bool,
    seeds: int,
    device: str,
    plugins: tuple[str, ...],
    as_json: bool,
) -> int:
    """Train NAME, an enhancer or a tracker, and write its weights as OUT/NAME.safetensors.

    A tracker (siamrpnpp) learns from pairs of crops: of two frames of a sequence with boxes, and
    of objects that are cut from photographs or drawn, and laid on them.

    The same command goes on where it was stopped or killed. Curves are in OUT/curve.csv and
    OUT/validation.csv, and in TensorBoard's form where that is installed.
    """
    shared.load_plugins(plugins)
    given: dict[str, Any] = shared.read_pairs(values, "--set")
    direct = {"steps": steps, "seed": seed, "best": best}
    given |= {key: value for key, value in direct.items() if value is not None}
    if steps is not None:
        given.setdefault("epochs", 0)
    kind = plugin_kind(name)
    of_enhancers = {
        "--cache": cache,
        "--validate-sequences": validate_sequences,
        "--validate-tracker": trackers,
        "--ablation": ablation,
    }
    check_options(name, kind, of_enhancers if kind == "tracker" else {"--photographs": photographs})
    if kind == "tracker":
        if only_settings:
            return training_trackers.show_settings(name, preset, given, as_json=as_json)
        chosen = {
            "out": out or Path("training") / name,
            "root": root,
            "options": shared.read_pairs(opts, "--opt"),
            "start": start,
            "device": shared.choose_device(device),
        }
        tracker = training_trackers.training_of(name, preset, given, data, photographs, **chosen)
        return training_trackers.run(tracker, minutes, as_json=as_json)
    if only_settings:
        return _show_settings(name, preset, given, as_json=as_json)
    if data is None:
        msg = "--data is missing: a folder of images, a video or a dataset"
        raise UsageError(msg)
    training = _training(
        name, preset, given, data=data, root=root, out=out, opts=opts, device=device
    )
    training = _with(training, start, cache, _tracking(validate_sequences, trackers, device))
    if ablation:
        return _run_ablation(training, seeds, minutes, as_json=as_json)
    return _run(training, minutes, as_json=as_json)


def _training(
    name: str,
    preset: str,
    values: dict[str, Any],
    *,
    data: str,
    root: Path | None,
    out: Path | None,
    opts: tuple[str, ...],
    device: str,
) -> "EnhancerTraining":
    from nat2024.enhancing.training import EnhancerTraining, choose_settings

    loop, pictures, own = choose_settings(name, preset, values)
    return EnhancerTraining(
        name,
        data,
        out or Path("training") / name,
        shared.read_pairs(opts, "--opt"),
        loop,
        pictures,
        own,
        root=root,
        device=shared.choose_device(device),
    )


def _with(
    training: "EnhancerTraining",
    start: Path | None,
    cache: Path | None,
    tracking: "Tracking | None",
) -> "EnhancerTraining":
    from dataclasses import replace

    return replace(training, start=start, cache=cache, tracking=tracking)


def _tracking(dataset: str | None, trackers: tuple[str, ...], device: str) -> "Tracking | None":
    if dataset is None:
        if trackers:
            msg = "--validate-tracker needs --validate-sequences"
            raise UsageError(msg)
        return None
    from nat2024.datasets import load_dataset
    from nat2024.enhancing.training import Tracking

    chosen = tuple(one for one in load_dataset(dataset) if one.is_annotated)
    if not chosen:
        msg = f"--validate-sequences {dataset}: no sequence with a box in every frame"
        raise UsageError(msg)
    names = trackers or (shared.DEFAULT_TRACKER,)
    return Tracking(names, chosen, shared.choose_device(device))


def _run(training: "EnhancerTraining", minutes: float | None, *, as_json: bool) -> int:
    from nat2024.enhancing.training import train_enhancer

    with Bars() as bars:
        report = train_enhancer(training, minutes=minutes, on_progress=bars, on_total=bars.begin)
    if as_json:
        print_json({"training": _document(report)})
        return 0
    _print(report)
    return 0


def _document(report: "EnhancerTrainingReport") -> dict[str, Any]:
    import dataclasses

    return dataclasses.asdict(report)


def _print(report: "EnhancerTrainingReport") -> None:
    loop = report.training
    print_loop(loop, f"{report.pictures} pictures")
    shown = [[name, show_number(loop.numbers[name])] for name in _SHOWN if name in loop.numbers]
    if shown:
        print_table(["Validation", "mean"], shown)
    click.echo(f"weights: {report.weights}")


def _run_ablation(
    training: "EnhancerTraining", seeds: int, minutes: float | None, *, as_json: bool
) -> int:
    from nat2024.enhancing.training import run_ablation, spread, tracking_script
    from nat2024.files import write_atomic

    with Bars() as bars:
        trained = run_ablation(
            training, seeds, minutes=minutes, on_progress=bars, on_total=bars.begin
        )
    script = training.out / "track.sh"
    write_atomic(script, tracking_script(training, trained))
    if as_json:
        runs = [{"variant": one.name, "seed": one.seed, **_document(one.report)} for one in trained]
        print_json({"ablation": spread(trained), "trainings": runs})
        return 0
    _print_ablation(trained)
    click.echo(f"to track them: sh {script} --tracker NAME --dataset NAME")
    return 0


def _print_ablation(trained: "list[Variant]") -> None:
    from nat2024.enhancing.training import spread

    found = spread(trained)
    shown = [name for name in _SHOWN if any(name in numbers for numbers in found.values())]
    rows = [
        [variant, *(_show_spread(numbers[name]) for name in shown)]
        for variant, numbers in found.items()
    ]
    seeds = len({one.seed for one in trained})
    title = f"mean ± standard deviation over {seeds} seed{'s' if seeds > 1 else ''}"
    print_table(["Variant", *shown], rows, title=title)


def _show_spread(one: "Spread") -> str:
    mean, deviation = (show_number(value, ".3f") for value in (one.mean, one.deviation))
    return mean if deviation == "-" else f"{mean} ±{deviation}"


def _show_settings(name: str, preset: str, values: dict[str, Any], *, as_json: bool) -> int:
    from nat2024.enhancing.training import choose_settings, list_presets

    records = choose_settings(name, preset, values)
    print_settings(name, "enhancer", preset, list_presets(name), records, as_json=as_json)
    return 0
