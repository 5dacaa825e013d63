"""`nat-bench dataset info`: what a dataset holds."""

from pathlib import Path

import click

from nat2024.cli import options as shared
from nat2024.cli.output import print_json, print_table


@click.command()
@click.argument("name_or_path")
@shared.root_option
@shared.json_option
@shared.messages
def command(name_or_path: str, root: Path | None, as_json: bool) -> None:
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
