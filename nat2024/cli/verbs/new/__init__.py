"""`nat-bench new`: one module a kind of plugin."""

import click

from nat2024.cli.groups import Verbs

_VERBS = {
    "enhancer": "Write a working plugin package for an enhancer.",
    "tracker": "Write a working plugin package for a tracker.",
}


@click.group(cls=Verbs, package=__name__, verbs=_VERBS)
def command() -> None:
    """Begin an enhancer or a tracker of your own: a package that runs and is tested as it is."""
