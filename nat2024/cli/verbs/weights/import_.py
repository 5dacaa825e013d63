"""`nat-bench weights import`: check a weights file and register it."""

from typing import TYPE_CHECKING

import click

from nat2024.cli import options as shared
from nat2024.cli.output import print_json
from nat2024.cli.verbs.weights.describing import (
    document_of,
    entry_options,
    read_options,
    title_of,
)

if TYPE_CHECKING:
    from nat2024.zoo.registered import RegisteredWeights


@click.command()
@click.argument("name")
@click.argument("file", type=click.Path())
@entry_options
@shared.plugin_option
@shared.json_option
@shared.messages
def command(
    name: str,
    file: str,
    variant: str | None,
    opts: tuple[str, ...],
    plugins: tuple[str, ...],
    as_json: bool,
) -> None:
    """Register FILE (or a folder) for the tracker or enhancer NAME.

    It is loaded as NAME would load it, which checks keys, shapes and safety, and kept as
    safetensors (what PyTorch cannot read is kept as it is). From then on NAME takes it wherever no
    weights are given. `--variant` and `--opt` are kept with it.
    """
    from nat2024.registry import load_plugin, plugin_kind
    from nat2024.weights import import_weights

    shared.load_plugins(plugins)
    before = {entry.record: entry for entry in _registered(name)}
    entry = import_weights(name, file, read_options(variant, opts))
    if as_json:
        print_json(document_of(entry))
        return
    card = load_plugin(name, plugin_kind(name)).card
    published = card.published_file(entry.source_sha256)
    if published:
        note = f", {published.note}" if published.note else ""
        click.echo(f"{title_of(entry)}: {published.name}{note}; licence: {published.licence}")
    elif entry.known_as:
        click.echo(f"{title_of(entry)}: {entry.known_as}")
    else:
        click.echo(
            f"{title_of(entry)}: fits, but is no published file that the card knows "
            f"(sha256 {entry.source_sha256})"
        )
    click.echo(f"registered as {entry.path}")
    replaced = before.get(entry.record)
    if replaced and replaced.source_sha256 != entry.source_sha256:
        click.echo(f"in place of {replaced.known_as or replaced.source}")


def _registered(name: str) -> "list[RegisteredWeights]":
    from nat2024.errors import NatBenchError
    from nat2024.weights import list_weights

    try:
        return list_weights(name)
    except NatBenchError:  # a record that cannot be read; an import may put it right
        return []
