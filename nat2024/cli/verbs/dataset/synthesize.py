"""`nat-bench dataset synthesize`: a small night dataset made by code."""

from pathlib import Path

import click

from nat2024.cli import options as shared


@click.command()
@click.argument("folder", type=click.Path(path_type=Path, file_okay=False))
@click.option("--sequences", type=click.IntRange(1, 99), default=2, show_default=True)
@click.option("--frames", type=click.IntRange(2), default=60, show_default=True, help="In each.")
@click.option("--seed", type=int, default=0, show_default=True)
@shared.messages
def command(folder: Path, sequences: int, frames: int, seed: int) -> None:
    """Render short plain night clips with exact boxes into FOLDER.

    The layout is that of UAVDark135: data_seq/NAME/00001.png and anno/NAME.txt.
    """
    from nat2024.datasets import write_sequence
    from nat2024.errors import UsageError
    from nat2024.night import Clip, render_clip

    if folder.is_dir() and any(folder.iterdir()):
        msg = f"{folder} is not empty; choose another folder"
        raise UsageError(msg)
    for number in range(1, sequences + 1):
        clip = Clip(f"vehicle{number}", frames=frames, seed=seed + number - 1)
        write_sequence(folder, clip.name, render_clip(clip))
    click.echo(f"nat-bench: {folder}: {sequences} sequences of {frames} frames", err=True)
