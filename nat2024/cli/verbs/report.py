"""`nat-bench report`: one HTML page that shows why a number is what it is."""

import contextlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import click

from nat2024.cli import options as shared
from nat2024.cli.output import print_json
from nat2024.cli.scoring import Scoring, print_notes, score_with_datasets, scoring_options

if TYPE_CHECKING:
    from nat2024.types import Dataset

_PAGE = "index.html"


@click.command()
@scoring_options
@click.option(
    "--out",
    type=click.Path(path_type=Path, file_okay=False),
    default=Path("report"),
    show_default=True,
    help="Folder that gets index.html.",
)
@click.option("--title", default="", metavar="TEXT", help="Heading of the page.")
@click.option(
    "--no-frames", is_flag=True, help="Look at no frame: no light, no pictures, much faster."
)
@shared.computed_attributes_option
@shared.json_option
@shared.messages
def command(
    scoring: Scoring,
    out: Path,
    title: str,
    no_frames: bool,
    computed_attributes: bool,
    as_json: bool,
) -> None:
    """Write one HTML page that works offline: tables, curves, every sequence.

    Scores under all protocols are in it; --protocol says which is shown first.
    """
    from nat2024.cli.reporting import build_model
    from nat2024.files import check_writable, expand, write_atomic
    from nat2024_reports.page import build_page

    path = expand(out) / _PAGE
    check_writable(path)
    scored = score_with_datasets(scoring, computed_attributes=computed_attributes)
    print_notes(one.evaluation for one in scored)
    model = build_model(
        scored, title=title, frames=not no_frames, on_length=scoring.on_length, progress=_bar
    )
    data = build_page(model).encode()
    write_atomic(path, data)
    if as_json:
        written = [{"path": str(path), "bytes": len(data)}]
        datasets = [
            {"name": part.name, "runs": len(part.runs), "sequences": len(part.sequences)}
            for part in model.datasets
        ]
        print_json({"written": written, "datasets": datasets})
    else:
        click.echo(f"{path}: {_size(len(data))}; open it in a browser")


@contextlib.contextmanager
def _bar(dataset: "Dataset") -> Iterator[Callable[[], object]]:
    """A bar on standard error, where that is a terminal; how many frames come is not known."""
    from tqdm import tqdm

    with tqdm(desc=dataset.name, unit="frame", disable=None) as bar:
        yield bar.update


def _size(count: int) -> str:
    return f"{count / 1e6:.1f} MB" if count >= 1e5 else f"{count / 1e3:.0f} kB"
