"""`nat-bench dataset synthesize`: a night dataset rendered from nothing."""

import re
from pathlib import Path

import click

from nat2024.cli import options as shared
from nat2024.cli.output import print_json

_TARGETS = ("car", "person", "bus", "bike", "truck", "boat", "van")
_MIXED = ("none", "partial", "none", "full")


@click.command()
@click.argument("folder", type=click.Path(path_type=Path, file_okay=False))
@click.option("--sequences", type=click.IntRange(1, 999), default=2, show_default=True)
@click.option("--frames", type=click.IntRange(2), default=60, show_default=True, help="In each.")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True)
@click.option("--size", default="640x360", show_default=True, metavar="WxH", help="Of the frames.")
@click.option(
    "--target",
    "targets",
    type=click.Choice(_TARGETS),
    multiple=True,
    help="Repeatable; sequences take them in turn, all kinds where left out.",
)
@click.option(
    "--occlusion",
    type=click.Choice(["none", "partial", "full", "mixed"]),
    default="mixed",
    show_default=True,
    help="Trees hide the target for a while; mixed: in every second sequence.",
)
@click.option("--out-of-view", is_flag=True, help="The view leaves the target for a while.")
@click.option(
    "--mean", type=float, help="Mean grey level 0..1; left out, by chance as in real footage."
)
@click.option(
    "--photographs",
    type=click.Path(path_type=Path, file_okay=False),
    help="Folder of daytime photographs that ground and walls are made of.",
)
@click.option("--png", is_flag=True, help="Write PNG without loss instead of JPEG.")
@click.option("--workers", type=click.IntRange(1), default=1, show_default=True, help="Processes.")
@shared.json_option
@shared.messages
def command(
    folder: Path,
    sequences: int,
    frames: int,
    seed: int,
    size: str,
    targets: tuple[str, ...],
    occlusion: str,
    out_of_view: bool,
    mean: float | None,
    photographs: Path | None,
    png: bool,
    workers: int,
    as_json: bool,
) -> None:
    """Render night sequences with exact boxes, visibility and attributes into FOLDER.

    The layout is that of UAVDark135: data_seq/NAME/00001.jpg, anno/NAME.txt, att/NAME.txt, and an
    index that names the attributes. The same options give the same dataset.
    """
    from nat2024.night import NightSettings
    from nat2024.synthesis import read_photographs, refuse_filled, synthesize

    refuse_filled(folder)
    pictures = read_photographs(photographs, seed) if photographs else ()
    kinds = targets or _TARGETS
    settings = [
        NightSettings(
            target=kinds[number % len(kinds)],  # type: ignore[arg-type]
            frames=frames,
            size=_read_size(size),
            seed=seed + number,
            occlusion=_MIXED[number % 4] if occlusion == "mixed" else occlusion,  # type: ignore[arg-type]
            out_of_view=out_of_view,
            mean=mean,
            photographs=pictures,
        )
        for number in range(sequences)
    ]
    made = synthesize(folder, settings, extension=".png" if png else ".jpg", workers=workers)
    if as_json:
        print_json({"folder": str(folder), "frame_size": size, "sequences": made})
        return
    click.echo(f"nat-bench: {folder}: {sequences} sequences of {frames} frames", err=True)


def _read_size(text: str) -> tuple[int, int]:
    from nat2024.errors import UsageError

    match = re.fullmatch(r"(\d{1,5})x(\d{1,5})", text)
    if not match:
        msg = f"--size {text!r}: expected WIDTHxHEIGHT, such as 640x360"
        raise UsageError(msg)
    return int(match[1]), int(match[2])
