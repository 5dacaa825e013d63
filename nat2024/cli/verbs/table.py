"""`nat-bench table`: scores as a paper prints them."""

from pathlib import Path

import click

from nat2024.cli import options as shared
from nat2024.cli.output import print_json
from nat2024.cli.scoring import Scoring, document, print_notes, print_scores, score, scoring_options


@click.command()
@scoring_options
@click.option(
    "--format",
    "form",
    type=click.Choice(["console", "markdown", "csv", "latex"]),
    default="console",
    show_default=True,
)
@click.option(
    "--out",
    type=click.Path(path_type=Path, dir_okay=False),
    help="Write to a file instead of standard output.",
)
@shared.json_option
@shared.messages
def command(
    scoring: Scoring,
    form: str,
    out: Path | None,
    as_json: bool,
) -> None:
    """Print scores as a paper's table.

    Gains are percent of the tracker alone: 0.434 against 0.372 is +16.667.
    """
    from nat2024.errors import UsageError
    from nat2024.files import write_atomic
    from nat2024_reports import overall_table, render

    if as_json and (form != "console" or out is not None):
        msg = "--json goes to standard output alone; leave out --format and --out"
        raise UsageError(msg)
    if form == "console" and out is not None:
        msg = "--out needs --format markdown, csv or latex"
        raise UsageError(msg)
    evaluations = score(scoring)
    print_notes(evaluations)
    if as_json:
        print_json(document(evaluations))
    elif form == "console":
        print_scores(evaluations)
    else:
        text = render([overall_table(e.summary()) for e in evaluations], form)
        if out is None:
            click.echo(text, nl=False)
        else:
            write_atomic(out, text)
