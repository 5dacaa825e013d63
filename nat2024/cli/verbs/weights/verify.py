"""`nat-bench weights verify`: are registered weights still what was imported."""

import click

from nat2024.cli import options as shared
from nat2024.cli.output import print_json
from nat2024.zoo.registered import describe_options


@click.command()
@click.argument("name", required=False)
@shared.plugin_option
@shared.json_option
@shared.messages
def command(name: str | None, plugins: tuple[str, ...], as_json: bool) -> int:
    """Check registered weights, of NAME or of all: sha256, keys and shapes.

    Exit status 1 where something is wrong.
    """
    from nat2024.weights import verify_weights

    shared.load_plugins(plugins)
    verdicts = verify_weights(name)
    ok = all(verdict.ok for verdict in verdicts)
    if as_json:
        print_json({"ok": ok, "weights": verdicts})
        return 0 if ok else 1
    for verdict in verdicts:
        options = f" ({describe_options(verdict.options)})" if verdict.options else ""
        known = verdict.known_as or "no published file"
        click.echo(f"{verdict.plugin}{options}: {verdict.problem or f'ok, {known}'}")
    if not verdicts:
        click.echo("nothing is registered")
    return 0 if ok else 1
