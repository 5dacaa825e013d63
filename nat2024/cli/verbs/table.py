"""`nat-bench table`: scores as a paper prints them."""

from pathlib import Path

import click

from nat2024.cli import options as shared
from nat2024.cli.output import print_json
from nat2024.cli.scoring import (
    Scoring,
    document,
    print_notes,
    score_with_datasets,
    scoring_options,
)
from nat2024.cli.tables import LAYOUTS, SCORE_NAMES, Wish, make_tables, print_tables
from nat2024.errors import UsageError


@click.command()
@scoring_options
@click.option("--layout", type=click.Choice(list(LAYOUTS)), default="overall", show_default=True)
@shared.table_format_option
@click.option(
    "--score",
    "metric",
    type=click.Choice(list(SCORE_NAMES)),
    default="success",
    show_default=True,
    help="What attributes, categories, sequences and protocols show.",
)
@click.option(
    "--intervals",
    is_flag=True,
    help="Show the 95 % interval of each gain, and the share of sequences that get better.",
)
@shared.computed_attributes_option
@click.option(
    "--out",
    type=click.Path(path_type=Path, dir_okay=False),
    help="Write to a file instead of standard output.",
)
@shared.json_option
@shared.messages
def command(
    scoring: Scoring,
    layout: str,
    form: str,
    metric: str,
    intervals: bool,
    computed_attributes: bool,
    out: Path | None,
    as_json: bool,
) -> None:
    """Print scores as a paper's table.

    Gains are percent of the tracker alone: 0.434 against 0.372 is +16.667. Those that may be noise
    are marked by ~, as a paired bootstrap over sequences tells.

    \b
    overall     trackers and enhancers, all scores
    enhancers   enhancers before each tracker, gains
    ablation    parts of an enhancer added one by one
    attributes  success by attribute; categories: by kind of target
    sequences   success by sequence
    protocols   the same results under every protocol
    speed       frames per second and milliseconds beside success
    failures    how often runs lost their targets, and the light there
    losses      the same for each sequence
    """  # noqa: D301 - \b keeps the lines apart
    from nat2024.files import write_atomic
    from nat2024_reports import render

    if as_json and (form != "console" or out is not None):
        msg = "--json goes to standard output alone; leave out --format and --out"
        raise UsageError(msg)
    if form == "console" and out is not None:
        msg = "--out needs --format markdown, csv, latex or html"
        raise UsageError(msg)
    scored = score_with_datasets(scoring, computed_attributes=computed_attributes)
    evaluations = [one.evaluation for one in scored]
    print_notes(evaluations)
    if as_json:
        print_json(document(evaluations))
        return
    tables = make_tables(
        scored, layout, Wish(metric, intervals, titles=form in ("markdown", "latex", "html"))
    )
    if form == "console":
        print_tables(tables)
    elif out is None:
        click.echo(render(tables, form), nl=False)
    else:
        write_atomic(out, render(tables, form))
