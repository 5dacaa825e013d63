"""`nat-bench dataset index`: write what a dataset holds, with checksums, into one file."""

from pathlib import Path

import click

from nat2024.cli import options as shared
from nat2024.cli.output import print_json


@click.command()
@click.argument("name_or_path")
@shared.root_option
@click.option(
    "--out",
    type=click.Path(path_type=Path, dir_okay=False),
    help="The file; nat-bench.json in the dataset's folder where left out.",
)
@click.option(
    "--attributes",
    type=click.Path(path_type=Path, dir_okay=False),
    metavar="FILE.csv",
    help="Labels to take in, as `dataset attributes --out` writes them; published ones stay.",
)
@click.option("--no-checksums", is_flag=True, help="Leave sizes and checksums of frames out.")
@click.option("--force", is_flag=True, help="Write a file that is there anew.")
@shared.json_option
@shared.messages
def command(
    name_or_path: str,
    root: Path | None,
    out: Path | None,
    attributes: Path | None,
    no_checksums: bool,
    force: bool,
    as_json: bool,
) -> None:
    """Write the index of a dataset: frames, checksums, boxes, categories, attributes.

    Loading and `validate` use it from then on. An index that lies elsewhere (--out) is loaded
    with --root naming the dataset's folder.
    """
    from nat2024.datasets.index import index_dataset, index_path, write_index
    from nat2024.datasets.labels import read_label_table, with_labels
    from nat2024.errors import UsageError

    path = out or index_path(name_or_path, root)
    if path.exists() and not force:
        msg = f"{path} is there already; --force writes it anew"
        raise UsageError(msg)
    table = None if attributes is None else read_label_table(attributes)
    document = index_dataset(name_or_path, root, checksums=not no_checksums)
    document = document if table is None else with_labels(document, table)
    write_index(document, path, force=force)
    frames = sum(s.frames.count for s in document.sequences)
    checksums = sum(len(s.frames.sha256) for s in document.sequences)
    if as_json:
        found = {"out": str(path), "schema": document.schema, "name": document.name}
        counts = {"sequences": len(document.sequences), "frames": frames, "checksums": checksums}
        print_json({**found, **counts})
        return
    sequences = len(document.sequences)
    click.echo(f"{path}: {sequences} sequences, {frames} frames, {checksums} checksums")
