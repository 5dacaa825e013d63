"""`nat-bench dataset darken`: night out of day."""

from pathlib import Path

import click

from nat2024.cli import options as shared
from nat2024.cli.output import print_json


@click.command()
@click.argument("name_or_path")
@shared.root_option
@click.option(
    "--out",
    type=click.Path(path_type=Path, file_okay=False),
    required=True,
    help="Folder that one dataset a level is written below.",
)
@click.option(
    "--levels",
    default="0.12,0.06,0.03",
    show_default=True,
    metavar="L1,L2",
    help="Mean grey levels 0..1 of the first frame; real night footage has 0.04 to 0.18.",
)
@click.option("--sequences", metavar="A,B", help="Only these sequences.")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True)
@click.option("--png", is_flag=True, help="Write PNG without loss instead of JPEG.")
@shared.json_option
@shared.messages
def command(
    name_or_path: str,
    root: Path | None,
    out: Path,
    levels: str,
    sequences: str | None,
    seed: int,
    png: bool,
    as_json: bool,
) -> int:
    """Make night out of a daytime dataset at each light level, with its ground truth kept.

    Writes OUT/NAME-LEVEL for each level. A sequence with a frame that cannot be read is named and
    left out, and the exit status is 1.
    """
    from nat2024.datasets import load_dataset
    from nat2024.synthesis import darken, level_folder

    wanted = _read_levels(levels)
    dataset = load_dataset(name_or_path, root, unannotated=True)
    if sequences is not None:
        dataset = dataset.select(shared.read_names([sequences]))
    extension = ".png" if png else ".jpg"
    done = darken(dataset, out, wanted, seed=seed, extension=extension)
    failed = [one.name for one in done if one.fault]
    folders = [str(level_folder(out, dataset.name, level)) for level in wanted]
    if as_json:
        print_json({"levels": wanted, "folders": folders, "sequences": done})
    else:
        for folder in folders:
            click.echo(f"{folder}: {len(done) - len(failed)} sequences")
        if failed:
            click.echo(f"{len(failed)} sequences left out: {', '.join(failed)}")
    return 1 if failed else 0


def _read_levels(text: str) -> list[float]:
    from nat2024.errors import UsageError

    try:
        return [float(part) for part in text.split(",") if part.strip()]
    except ValueError:
        msg = f"--levels {text!r}: expected numbers separated by commas, such as 0.12,0.06"
        raise UsageError(msg) from None
