"""The command line: parse, call one library function, print.

Verbs are imported when they are used, so that `nat-bench --help` answers at once.
"""

import os
import sys
from collections.abc import Sequence
from typing import Any

import click

from nat2024.cli.groups import Verbs
from nat2024.cli.terminal import harmless_terminal
from nat2024.memory import keep_freed_memory

_VERBS = {
    "run": "Track a dataset with every tracker and enhancer named.",
    "merge": "Bring results together that were made apart, such as shards.",
    "eval": "Score stored results.",
    "table": "Print scores as a paper's table, gains included.",
    "plot": "Draw scores as a paper does: curves, attributes, gains, errors, speed.",
    "show": "Show what runs did: strips of telling frames, videos with boxes.",
    "report": "Write one HTML page that shows why the numbers are what they are.",
    "reproduce": "Put a paper's tables beside what its authors' result files give.",
    "export": "Write stored results in other toolkits' layouts, or theirs in ours.",
    "enhance": "Enhance images, videos or whole datasets, without a tracker.",
    "list": "Show trackers, enhancers and datasets.",
    "weights": "Register weights files, so that plugins find them.",
    "dataset": "Look at datasets, check them, make a small one.",
    "track": "Track an object in your own video, camera or stream.",
    "profile": "Measure what trackers and enhancers cost.",
    "train": "Train an enhancer on pictures, by the paper's recipe or your own.",
    "new": "Begin an enhancer or a tracker of your own.",
}


@click.group(
    cls=Verbs,
    package="nat2024.cli.verbs",
    verbs=_VERBS,
    context_settings={"help_option_names": ["-h", "--help"]},
)
@click.option("--debug", is_flag=True, expose_value=False, help="Show the traceback of an error.")
@click.version_option(package_name="nat-bench")
def cli() -> None:
    """Benchmark low-light enhancers and trackers on night video from drones.

    \b
    nat-bench run --tracker mil --enhancer none --enhancer clahe --dataset FOLDER
    nat-bench table --results results

    Exit status: 0 done, 1 some sequences failed, 2 wrong usage or input.
    """  # noqa: D301 - \b keeps the two lines apart


def main(args: Sequence[str] | None = None) -> None:
    """Run the command line and leave with its exit status."""
    # Read when torch is loaded. Threads that wait busily keep those of another runtime, or of
    # another program, from computing: with two threads a frame then takes ten times as long.
    os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")
    keep_freed_memory()
    sys.exit(run(args))


def run(args: Sequence[str] | None = None) -> int:
    """Run the command line; every foreseen error is one line on standard error."""
    words = list(sys.argv[1:] if args is None else args)
    with harmless_terminal():
        return _run(words)


def _run(words: list[str]) -> int:
    debug = "--debug" in words
    try:
        status: Any = cli.main(words, prog_name="nat-bench", standalone_mode=False)
    except click.exceptions.Abort:
        click.echo("nat-bench: stopped; what was finished is kept", err=True)
        return 130
    except click.exceptions.NoArgsIsHelpError as error:
        click.echo(error.format_message())
        return 0
    except click.ClickException as error:
        return _complain(error.format_message(), debug)
    except SystemExit:  # click leaves so where the reader of our output has gone
        return 0
    except OSError as error:
        where = f"{error.filename}: " if error.filename else ""
        return _complain(f"{where}{error.strerror or error}", debug)
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
