"""`nat-bench dataset`: look at datasets, check them, make a small one."""

from pathlib import Path

import click

from nat2024.cli import options as shared
from nat2024.cli.output import print_json, print_table


@click.group()
def command() -> None:
    """Look at datasets, check them against what is published, make a small one."""


@command.command()
@click.argument("name_or_path")
@shared.root_option
@shared.json_option
@shared.messages
def info(name_or_path: str, root: Path | None, as_json: bool) -> None:
    """Say what a dataset holds: layout, sequences, frames, boxes, attributes."""
    from nat2024.datasets import describe

    found = describe(name_or_path, root)
    if as_json:
        print_json(found)
        return
    click.echo(f"{found.name}: {found.title or 'not a registered dataset'}")
    click.echo(f"layout: {found.layout}")
    click.echo(f"frames: {found.frames} in {len(found.sequences)} sequences")
    for heading, names in (
        ("boxes on some frames only", found.keyframed),
        ("no boxes", found.unannotated),
        ("problems", found.problems),
    ):
        if names:
            click.echo(f"{heading}: {', '.join(names)}")
    rows = [
        [
            one.name,
            _box(one.first_box),
            " ".join(one.attributes),
            str(one.frames),
            f"{one.width}x{one.height}",
            str(one.annotated),
            str(one.absent + one.zero_size),
        ]
        for one in found.sequences
    ]
    headings = ["Sequence", "First box", "Attributes", "Frames", "Size", "Boxes", "Invalid"]
    print_table(headings, rows, words=3)


def _box(box: tuple[float, float, float, float] | None) -> str:
    return ",".join(f"{value:g}" for value in box) if box else "-"


@command.command()
@click.argument("name_or_path")
@shared.root_option
@click.option("--every-frame", is_flag=True, help="Decode all frames, not only the first.")
@shared.json_option
@shared.messages
def validate(name_or_path: str, root: Path | None, every_frame: bool, as_json: bool) -> int:
    """Check a download: names, lengths and first boxes against the published ones.

    Exit status 1 where something is missing, extra or altered.
    """
    from nat2024.datasets import validate as check

    report = check(name_or_path, root, every_frame=every_frame)
    if as_json:
        print_json(report)
        return 0 if report.ok else 1
    click.echo(f"{report.name}: {report.sequences} sequences, {report.frames} frames")
    against = report.checked_against or "itself alone: no published facts fit it"
    click.echo(f"checked against: {against}")
    for finding in report.problems:
        click.echo(f"problem: {finding.message}")
    for note in report.notes:
        click.echo(f"note: {note}")
    for what in report.unchecked:
        click.echo(f"not checked: {what}")
    click.echo("ok" if report.ok else f"{len(report.problems)} problems")
    return 0 if report.ok else 1


@command.command()
@click.argument("folder", type=click.Path(path_type=Path, file_okay=False))
@click.option("--sequences", type=click.IntRange(1, 99), default=2, show_default=True)
@click.option("--frames", type=click.IntRange(2), default=60, show_default=True, help="In each.")
@click.option("--seed", type=int, default=0, show_default=True)
@shared.messages
def synthesize(folder: Path, sequences: int, frames: int, seed: int) -> None:
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
