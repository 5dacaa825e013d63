"""`nat-bench merge`: results that were made apart, together."""

from pathlib import Path

import click

from nat2024.cli import options as shared
from nat2024.cli.output import print_json


@click.command()
@click.argument(
    "shards",
    nargs=-1,
    required=True,
    metavar="SHARD...",
    type=click.Path(path_type=Path, exists=True, file_okay=False),
)
@click.option(
    "--out",
    type=click.Path(path_type=Path, file_okay=False),
    required=True,
    metavar="DIR",
    help="Where all goes; results that are there already take part.",
)
@click.option(
    "--other-versions",
    is_flag=True,
    help="Even where results were made with other versions of libraries.",
)
@shared.json_option
@shared.messages
def command(shards: tuple[Path, ...], out: Path, other_versions: bool, as_json: bool) -> int:
    """Bring results folders together, such as those of `run --shard` on several machines.

    Manifests must agree on options, weights, scope, device, threads, dataset and versions, and
    boxes of the same sequence must be the same; everything is checked before anything is written.
    Shards that are missing are named. With --json: folder, runs, copied, present, failures and
    incomplete.
    """
    from nat2024.engine import merge_results

    report = merge_results(shards, out, other_versions=other_versions)
    if as_json:
        print_json(report)
    else:
        there = f", {report.present} there already" if report.present else ""
        failed = f", {report.failures} failed" if report.failures else ""
        click.echo(f"{out}: {len(report.runs)} runs, {report.copied} sequences{there}{failed}")
    return 1 if report.failures else 0
