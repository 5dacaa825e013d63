"""`nat-bench reproduce`: a paper's tables beside what its authors' result files give."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from nat2024.cli import options as shared
from nat2024.cli.output import print_json, print_table

if TYPE_CHECKING:
    from nat2024.reproducing import Reproduction
    from nat2024_reports import Table

PAPERS = ("ldenhancer",)
"""As `nat2024.reproducing.PUBLICATIONS`, which is imported only when it is used."""

_MOST_LINES = 10


@click.command()
@click.argument("paper", type=click.Choice(PAPERS))
@shared.root_option
@click.option(
    "--results",
    type=click.Path(path_type=Path),
    multiple=True,
    required=True,
    help="A folder or .zip of the authors' result files; repeatable.",
)
@shared.protocol_option
@shared.table_format_option
@click.option(
    "--out",
    type=click.Path(path_type=Path, dir_okay=False),
    help="Write to a file instead of standard output.",
)
@shared.json_option
@shared.messages
def command(
    paper: str,
    root: Path | None,
    results: tuple[Path, ...],
    protocol: str,
    form: str,
    out: Path | None,
    as_json: bool,
) -> int:
    """Put a paper's tables beside what published result files give.

    ldenhancer: Tables IV and V of LDEnhancer (IROS 2024), SiamRPN++ on UAVDark135. --root is your
    copy of UAVDark135, --results the `results` folder of the authors' repository; add that of SCT
    for the row of SCT. The copy is held against the published names, lengths and first boxes.

    Exit status 1 where the copy is not as published or a result could not be scored. With --json:
    paper, source, dataset, protocol, copy_problems, rows (paper, files, difference, equal, note),
    remarks and left_out.
    """
    from nat2024.reproducing import reproduce

    _check(form, out, as_json=as_json)
    found = reproduce(paper, results, root, protocol=protocol)
    _tell(found)
    if as_json:
        print_json(found)
    else:
        _print(_tables(found), form, out)
    return 0 if found.ok else 1


def _check(form: str, out: Path | None, *, as_json: bool) -> None:
    from nat2024.errors import UsageError

    if as_json and (form != "console" or out is not None):
        msg = "--json goes to standard output alone; leave out --format and --out"
        raise UsageError(msg)
    if form == "console" and out is not None:
        msg = "--out needs --format markdown, csv, latex or html"
        raise UsageError(msg)


def _tell(found: "Reproduction") -> None:
    """Say on standard error what is wrong with the copy, and what of the files."""
    import logging

    log = logging.getLogger("nat2024")
    problems = found.copy_problems
    if problems:
        log.error("this copy of %s is not as published:", found.dataset)
    for problem in problems[:_MOST_LINES]:
        log.error("  %s", problem)
    if len(problems) > _MOST_LINES:
        log.error("  %d more; `nat-bench dataset validate` shows all", len(problems) - _MOST_LINES)
    for remark in found.remarks:
        log.info("%s", remark)


def _tables(found: "Reproduction") -> "list[Table]":
    import msgspec

    from nat2024_reports.layouts.reproduced import reproduced_tables

    rows: list[dict[str, Any]] = msgspec.to_builtins(found.rows)
    facts = {"paper": found.source, "dataset": found.dataset, "protocol": found.protocol}
    return reproduced_tables(rows, facts)


def _print(tables: "list[Table]", form: str, out: Path | None) -> None:
    from nat2024.files import write_atomic
    from nat2024_reports import render

    if form == "console":
        for table in tables:
            rows = [[cell.text for cell in row] for row in table.rows]
            print_table(table.headings, rows, title=table.caption, words=table.words)
            for note in table.footnotes:
                click.echo(f"  {note}")
            click.echo()
        return
    text = render(tables, form)
    if out is None:
        click.echo(text, nl=False)
    else:
        write_atomic(out, text)
