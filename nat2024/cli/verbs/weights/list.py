"""`nat-bench weights list`: what is registered."""

import click

from nat2024.cli import options as shared
from nat2024.cli.output import print_json, print_table
from nat2024.cli.verbs.weights.describing import document_of
from nat2024.zoo.registered import describe_options, weights_folder


@click.command()
@click.argument("name", required=False)
@shared.json_option
@shared.messages
def command(name: str | None, as_json: bool) -> None:
    """Show registered weights, of NAME or of all."""
    from nat2024.weights import list_weights

    found = list_weights(name)
    if as_json:
        folder = str(weights_folder())
        print_json({"folder": folder, "weights": [document_of(entry) for entry in found]})
        return
    rows = [
        [
            entry.plugin,
            describe_options(entry.options),
            entry.known_as or "no published file",
            entry.source_sha256[:12],
            f"{entry.bytes / 1e6:.2f}",
        ]
        for entry in found
    ]
    headings = ["Plugin", "Options", "Known as", "sha256", "MB"]
    print_table(headings, rows, title=str(weights_folder()), words=4)
