"""`nat-bench dataset`: one module a verb."""

import click

from nat2024.cli.groups import Verbs

_VERBS = {
    "info": "Say what a dataset holds.",
    "validate": "Check a download against the published facts.",
    "attributes": "Compute attributes such as fast motion or uneven light.",
    "stats": "Write the tables and figures of a dataset paper.",
    "index": "Write frames, checksums and annotation into one file.",
    "convert": "Write a dataset in another format, without losing a value.",
    "schema": "Print the JSON Schema of an index.",
    "synthesize": "Render night sequences with exact boxes from nothing.",
    "darken": "Make night out of a daytime dataset, its boxes kept.",
}


@click.group(cls=Verbs, package=__name__, verbs=_VERBS)
def command() -> None:
    """Look at datasets, check them against what is published, make a small one."""
