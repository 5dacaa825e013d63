"""`nat-bench dataset validate`: is a download whole and unaltered."""

from pathlib import Path

import click

from nat2024.cli import options as shared
from nat2024.cli.output import print_json


@click.command()
@click.argument("name_or_path")
@shared.root_option
@click.option("--every-frame", is_flag=True, help="Decode all frames, not only the first.")
@shared.json_option
@shared.messages
def command(name_or_path: str, root: Path | None, every_frame: bool, as_json: bool) -> int:
    """Check a download: names, lengths and first boxes against the published ones.

    Exit status 1 where something is missing, extra or altered.
    """
    from nat2024.datasets import validate as check

    report = check(name_or_path, root, every_frame=every_frame)
    if as_json:
        print_json(report)
        return 0 if report.ok else 1
    click.echo(f"{report.name}: {report.sequences} sequences, {report.frames} frames")
    against = report.checked_against or report.index or "itself alone: no published facts fit it"
    click.echo(f"checked against: {against}")
    for finding in report.problems:
        click.echo(f"problem: {finding.message}")
    for note in report.notes:
        click.echo(f"note: {note}")
    for what in report.unchecked:
        click.echo(f"not checked: {what}")
    click.echo("ok" if report.ok else f"{len(report.problems)} problems")
    return 0 if report.ok else 1
