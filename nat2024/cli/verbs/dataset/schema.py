"""`nat-bench dataset schema`: the JSON Schema of an index file."""

import click

from nat2024.cli import options as shared
from nat2024.cli.output import print_json


@click.command()
@shared.json_option
@shared.messages
def command(as_json: bool) -> None:  # noqa: ARG001
    """Print the JSON Schema of an index file (with or without --json)."""
    from nat2024.datasets.schema import json_schema

    print_json(json_schema())
