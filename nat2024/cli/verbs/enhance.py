"""`nat-bench enhance`: images, videos and datasets through enhancers, without a tracker."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import msgspec

from nat2024.cli import options as shared
from nat2024.cli.enhancement_measuring import MeasuringOptions, measuring_options, print_measures
from nat2024.cli.enhancing import (
    check_files,
    choose_strip,
    picture_options,
    read_picture_options,
    write_maps,
    write_pictures,
)
from nat2024.cli.output import print_json
from nat2024.cli.progress import ProgressBar

if TYPE_CHECKING:
    from nat2024.enhancing import EnhancementReport

_LINES = 8


@click.command()
@click.argument("source", metavar="INPUT")
@click.option(
    "--enhancer",
    "enhancers",
    multiple=True,
    required=True,
    metavar="NAME[@LABEL],...",
    help="One or more; repeatable.",
)
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    required=True,
    help="Folder; each enhancer writes to one of its own in it.",
)
@shared.root_option
@shared.weights_option
@shared.opts_option
@shared.device_option
@shared.backend_option("torch")
@shared.precision_option
@click.option(
    "--feed",
    type=click.Choice(["image", "tracker"]),
    default="image",
    show_default=True,
    help="Colours as the authors' stand-alone tests feed them, or BGR as trackers feed frames.",
)
@click.option("--images", "as_images", is_flag=True, help="Read a folder as images, no dataset.")
@click.option("--sequences", metavar="A,B", help="Of a dataset, only these sequences.")
@click.option(
    "--every",
    type=click.IntRange(1),
    default=1,
    show_default=True,
    metavar="N",
    help="Every Nth image of a folder, or frame of a video.",
)
@click.option(
    "--limit", type=click.IntRange(1), metavar="N", help="At most so many images or frames."
)
@click.option(
    "--quality",
    type=click.IntRange(1, 100),
    default=95,
    show_default=True,
    help="Of images stored as JPEG.",
)
@click.option("--frames", "frames_only", is_flag=True, help="A video's frames as PNG, no video.")
@measuring_options
@picture_options
@shared.plugin_option
@shared.json_option
@shared.messages
def command(
    source: str,
    enhancers: tuple[str, ...],
    out: Path,
    root: Path | None,
    weights: tuple[str, ...],
    opts: tuple[str, ...],
    device: str,
    backend: Any,
    precision: Any,
    feed: Any,
    as_images: bool,
    sequences: str | None,
    every: int,
    limit: int | None,
    quality: int,
    frames_only: bool,
    plugins: tuple[str, ...],
    as_json: bool,
    measuring: MeasuringOptions,
    **pictures: Any,
) -> int:
    """Enhance INPUT: an image, a folder of images, a video, or a dataset.

    Writes OUT/ENHANCER/ with the names of the input; a dataset stays one, its boxes beside it.
    What is there already is kept, so the same command goes on where it was stopped. An image that
    fails is named, and the others go on.
    """
    from nat2024.enhancing import count_images, create_enhancers, enhance_images, find_source

    wanted = read_picture_options(**pictures)
    shared.load_plugins(plugins)
    titles = _split(enhancers)
    found = find_source(
        source,
        root,
        as_images=as_images,
        sequences=None if sequences is None else _split((sequences,)),
        every=every,
        limit=limit,
    )
    strip = choose_strip(wanted, found)
    asked: dict[str, Any] = {
        "options": shared.read_plugin_options(opts),
        "weights": shared.read_pairs(weights, "--weights"),
        "device": shared.choose_device(device),
        "backend": backend,
        "precision": precision,
    }
    check_files(wanted, (measuring.csv_file, measuring.fit_curve))
    observer = measuring.start(titles, count_images(found), asked["device"])
    with ProgressBar(len(titles) * count_images(found), "image") as progress:
        report = enhance_images(
            found,
            titles,
            out,
            feed=feed,
            quality=quality,
            frames_only=frames_only,
            observer=observer,
            progress=progress,
            **asked,
        )
    measured = measuring.finish(observer)
    drawn, failed = write_pictures(wanted, found, strip, out, titles), 0
    if wanted.maps:
        maps, failed = write_maps(wanted, found, out, create_enhancers(titles, **asked), feed)
        drawn += maps
    _print(report, drawn, measured, as_json)
    return 1 if report.failures or failed else 0


def _split(texts: tuple[str, ...]) -> list[str]:
    return [part.strip() for text in texts for part in text.split(",") if part.strip()]


def _print(
    report: "EnhancementReport", drawn: list[Path], measured: dict[str, Any], as_json: bool
) -> None:
    if as_json:
        document: dict[str, Any] = msgspec.to_builtins(report)
        print_json({**document, "pictures": [str(path) for path in drawn], **measured})
        return
    for one in report.enhancers:
        parts = [f"{one.written} images written"]
        parts += [f"{one.finished_before} finished before"] if one.finished_before else []
        parts += [f"{one.failed} failed"] if one.failed else []
        click.echo(f"{one.folder}: {', '.join(parts)}")
    for path in [path for path in drawn if path.suffix != ".csv"][:_LINES]:
        click.echo(str(path))
    if len(drawn) > 2 * _LINES:
        click.echo(f"and more, {len(drawn)} files of pictures and their numbers")
    print_measures(measured)
