"""Groups of verbs that are imported when they are used, so that help answers at once."""

from collections.abc import Mapping
from importlib import import_module
from keyword import iskeyword
from typing import Any

import click


class Verbs(click.Group):
    """A group whose verbs live in modules of their own names, each as `command`."""

    def __init__(self, *args: Any, package: str, verbs: Mapping[str, str], **kwargs: Any) -> None:
        """Keep where the verbs are.

        Args:
            args: as for `click.Group`.
            package: package that holds a module for each verb.
            verbs: one line of help by verb, in the order in which people need them.
            kwargs: as for `click.Group`.
        """
        super().__init__(*args, **kwargs)
        self.package = package
        self.verbs = verbs

    def list_commands(self, ctx: click.Context) -> list[str]:  # noqa: ARG002
        """Names in their order."""
        return list(self.verbs)

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:  # noqa: ARG002
        """Import the module of a verb."""
        if name not in self.verbs:
            return None
        module = f"{name}_" if iskeyword(name) else name  # `import` is no name for a module
        command: click.Command = import_module(f"{self.package}.{module}").command
        return command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """As click's, with the closest verbs in the error."""
        if args and args[0] not in self.verbs and not args[0].startswith("-"):
            from nat2024.types import closest

            ctx.fail(f"no such command {args[0]!r}{closest(args[0], self.verbs)}")
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:  # noqa: ARG002
        """List the verbs without importing them."""
        with formatter.section("Commands"):
            formatter.write_dl(list(self.verbs.items()))
