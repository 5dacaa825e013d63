"""How registered weights are shown by the verbs of `nat-bench weights`."""

from collections.abc import Callable
from typing import Any, TypeVar

import click

from nat2024.cli import options as shared
from nat2024.errors import UsageError
from nat2024.zoo.registered import RegisteredWeights, describe_options

_Function = TypeVar("_Function", bound=Callable[..., Any])


def entry_options(function: _Function) -> _Function:
    """Add `--variant` and `--opt`, which together name an entry; read them by `read_options`."""
    function = click.option(
        "--opt",
        "opts",
        multiple=True,
        metavar="KEY=VALUE",
        help="An option of the plugin that the weights are for; repeatable.",
    )(function)
    return click.option(
        "--variant", help="The variant that the weights are for, as --opt variant=NAME."
    )(function)


def read_options(variant: str | None, opts: tuple[str, ...]) -> dict[str, str]:
    """Options by name.

    Raises:
        UsageError: one is no KEY=VALUE, or comes twice.
    """
    options = shared.read_pairs(opts, "--opt")
    if variant is None:
        return options
    if "variant" in options:
        msg = "--opt variant and --variant are given together; one is enough"
        raise UsageError(msg)
    return {"variant": variant, **options}


def title_of(entry: RegisteredWeights) -> str:
    """The plugin, with the options that the weights are for."""
    options = describe_options(entry.options)
    return f"{entry.plugin} ({options})" if options else entry.plugin


def document_of(entry: RegisteredWeights) -> dict[str, Any]:
    """The record and where its weights lie, for JSON."""
    fields = {name: getattr(entry, name) for name in entry.__struct_fields__}
    return {**fields, "path": str(entry.path)}
