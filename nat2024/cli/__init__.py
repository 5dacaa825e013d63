"""The command line: parse, call one library function, print.

Verbs are imported when they are used, so that `nat-bench --help` answers at once.
"""

import sys
from collections.abc import Sequence
from importlib import import_module
from typing import Any

import click

_VERBS = {
    "run": "Track a dataset with every tracker and enhancer named.",
    "eval": "Score stored results.",
    "table": "Print scores as a paper's table, gains included.",
    "list": "Show trackers, enhancers and datasets.",
    "dataset": "Look at datasets: info, validate, synthesize.",
}


class Verbs(click.Group):
    """The group of verbs; each lives in a module of its own name under `nat2024.cli.verbs`."""

    def list_commands(self, ctx: click.Context) -> list[str]:  # noqa: ARG002
        """Names in the order in which people need them."""
        return list(_VERBS)

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:  # noqa: ARG002
        """Import the module of a verb."""
        if name not in _VERBS:
            return None
        command: click.Command = import_module(f"nat2024.cli.verbs.{name}").command
        return command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """As click's, with the closest verbs in the error."""
        if args and args[0] not in _VERBS and not args[0].startswith("-"):
            from nat2024.types import closest

            ctx.fail(f"no such command {args[0]!r}{closest(args[0], _VERBS)}")
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:  # noqa: ARG002
        """List the verbs without importing them."""
        with formatter.section("Commands"):
            formatter.write_dl(list(_VERBS.items()))


@click.group(cls=Verbs, context_settings={"help_option_names": ["-h", "--help"]})
@click.option("--debug", is_flag=True, expose_value=False, help="Show the traceback of an error.")
@click.version_option(package_name="nat-bench")
def cli() -> None:
    r"""Benchmark low-light enhancers and trackers on night video from drones.

    \b
    nat-bench run --tracker mil --enhancer none --enhancer clahe --dataset FOLDER
    nat-bench table --results results

    Exit status: 0 done, 1 some sequences failed, 2 wrong usage or input.
    """


def main(args: Sequence[str] | None = None) -> None:
    """Run the command line and leave with its exit status."""
    sys.exit(run(args))


def run(args: Sequence[str] | None = None) -> int:
    """Run the command line; every foreseen error is one line on standard error."""
    words = list(sys.argv[1:] if args is None else args)
    debug = "--debug" in words
    try:
        status: Any = cli.main(words, prog_name="nat-bench", standalone_mode=False)
    except click.exceptions.Abort:
        click.echo("nat-bench: stopped; finished sequences are kept", err=True)
        return 130
    except click.ClickException as error:
        return _complain(error.format_message(), debug)
    except BrokenPipeError:
        sys.stderr.close()  # the reader of our output has gone; there is nobody to tell
        return 0
    except Exception as error:
        from nat2024.errors import NatBenchError

        if not isinstance(error, NatBenchError):
            raise
        return _complain(str(error), debug)
    return status if isinstance(status, int) else 0


def _complain(message: str, debug: bool) -> int:
    if debug:
        import traceback

        traceback.print_exc()
    click.echo(f"nat-bench: {' '.join(message.split())}", err=True)
    return 2
