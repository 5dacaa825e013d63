"""The verb `nat-bench new KIND`, the same for enhancers and trackers."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from nat2024.cli import options as shared
from nat2024.cli.output import print_json

if TYPE_CHECKING:
    from nat2024.registry import Kind


def new_command(kind: "Kind") -> click.Command:
    """The command that writes a plugin package of one kind."""

    @click.command(name=kind, help=_HELP.format(kind=kind))
    @click.argument("name")
    @click.option(
        "--out",
        type=click.Path(path_type=Path),
        metavar="DIR",
        help="Folder of the package, absent or empty (default: NAME).",
    )
    @click.option("--network", is_flag=True, help="With a network in PyTorch, and its weights.")
    @shared.json_option
    @shared.messages
    def command(name: str, out: Path | None, network: bool, as_json: bool) -> None:
        from nat2024.scaffolding import write_plugin_package

        folder = write_plugin_package(kind, name, out, network=network)
        files = sorted(str(f.relative_to(folder)) for f in folder.rglob("*") if f.is_file())
        if as_json:
            print_json({"name": name, "kind": kind, "folder": str(folder), "files": files})
            return
        click.echo(f"{folder}: {len(files)} files")
        for file in files:
            click.echo(f"  {file}")
        click.echo(f"Next: pip install -e {folder}, and its README.md says how to go on.")

    return command


_HELP = """Write a working plugin package for the {kind} NAME.

It has an entry point, a card, a method to be replaced by yours, and tests with the conformance
suite. With --json: name, kind, folder and files.
"""
