"""`nat-bench dataset convert`: between annotation formats, without losing a value."""

from pathlib import Path

import click

from nat2024.cli import options as shared
from nat2024.cli.output import print_json


@click.command()
@click.argument("source")
@click.argument("out", type=click.Path(path_type=Path))
@click.option(
    "--to",
    "to",
    required=True,
    metavar="FORMAT",
    help="index, published, got10k, pysot or coco-video.",
)
@click.option("--from", "source_format", metavar="FORMAT", help="Found out where left out.")
@click.option(
    "--frames",
    type=click.Choice(["copy", "link", "none"]),
    default="copy",
    show_default=True,
    help="Copy frames, make hard links to them, or write annotation alone.",
)
@shared.root_option
@shared.json_option
@shared.messages
def command(
    source: str,
    out: Path,
    to: str,
    source_format: str | None,
    frames: str,
    root: Path | None,
    as_json: bool,
) -> None:
    """Write the dataset SOURCE in another format into the new folder OUT.

    What a format has no field for goes into a side file, so that converting back gives the same
    values.
    """
    from nat2024.datasets.conversion import convert

    done = convert(source, out, to, root=root, source_format=source_format, frames=frames)
    if as_json:
        print_json(done)
        return
    click.echo(f"{done.out}: {done.sequences} sequences, {done.frames} frames as {done.format}")
    click.echo(f"read as: {done.source}")
    files = f"{done.copied} frame files copied, {done.linked} linked"
    click.echo(f"written: {done.annotation_files} annotation files, {files}")
    for remark in done.remarks:
        click.echo(f"note: {remark}")
