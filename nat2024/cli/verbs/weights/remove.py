"""`nat-bench weights remove`: forget registered weights."""

import click

from nat2024.cli import options as shared
from nat2024.cli.output import print_json
from nat2024.cli.verbs.weights.describing import (
    document_of,
    entry_options,
    read_options,
    title_of,
)


@click.command()
@click.argument("name")
@entry_options
@click.option("--all", "every", is_flag=True, help="Remove all that fit, not only one.")
@shared.json_option
@shared.messages
def command(
    name: str, variant: str | None, opts: tuple[str, ...], every: bool, as_json: bool
) -> None:
    """Remove the registered weights of NAME; the files they were imported from stay."""
    from nat2024.weights import remove_weights

    removed = remove_weights(name, read_options(variant, opts), every=every)
    if as_json:
        print_json({"removed": [document_of(entry) for entry in removed]})
        return
    for entry in removed:
        click.echo(f"removed {title_of(entry)}: {entry.path}")
