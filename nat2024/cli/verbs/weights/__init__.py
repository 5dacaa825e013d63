"""`nat-bench weights`: one module a verb (that of `import` has an underscore)."""

import click

from nat2024.cli.groups import Verbs

_VERBS = {
    "import": "Check a weights file and register it for its plugin.",
    "list": "Show registered weights.",
    "verify": "Check registered weights: digests, keys and shapes.",
    "remove": "Forget registered weights.",
}


@click.group(cls=Verbs, package=__name__, verbs=_VERBS)
def command() -> None:
    """Register weights files once, so that plugins find them by themselves.

    They lie in the folder that NAT2024_WEIGHTS names, else in the user's data folder. Nothing is
    ever downloaded.
    """
