"""`nat-bench list`: what there is to run."""

import importlib.metadata
from typing import TYPE_CHECKING, Any

import click

from nat2024.cli import options as shared
from nat2024.cli.output import print_json, print_table

if TYPE_CHECKING:
    from nat2024.registry import Kind

_OPENCV = (
    "opencv-python",
    "opencv-python-headless",
    "opencv-contrib-python",
    "opencv-contrib-python-headless",
)


@click.command()
@click.argument("pattern", default="*")
@click.option("--trackers", is_flag=True, help="Only trackers.")
@click.option("--enhancers", is_flag=True, help="Only enhancers.")
@click.option("--datasets", is_flag=True, help="Only datasets.")
@shared.plugin_option
@shared.json_option
@shared.messages
def command(
    pattern: str,
    trackers: bool,
    enhancers: bool,
    datasets: bool,
    plugins: tuple[str, ...],
    as_json: bool,
) -> None:
    """Show trackers, enhancers and datasets whose names match PATTERN, such as "siam*"."""
    shared.load_plugins(plugins)
    everything = not (trackers or enhancers or datasets)
    found: dict[str, list[dict[str, Any]]] = {}
    if trackers or everything:
        found["trackers"] = _plugins("tracker", pattern)
    if enhancers or everything:
        found["enhancers"] = _plugins("enhancer", pattern)
    if datasets or everything:
        found["datasets"] = _datasets(pattern)
    _warn_of_two_opencvs()
    if as_json:
        print_json(found)
        return
    for kind, rows in found.items():
        columns = ("name", "title", "needs", "state")
        lines = [[str(row[column]) for column in columns] for row in rows]
        print_table([c.capitalize() for c in columns], lines, title=kind.capitalize(), words=4)


def _plugins(kind: "Kind", pattern: str) -> list[dict[str, Any]]:
    from nat2024.errors import BrokenPlugin
    from nat2024.registry import list_plugins, load_plugin, plugin_options

    rows: list[dict[str, Any]] = []
    for name in list_plugins(kind, pattern):
        try:
            cls = load_plugin(name, kind)
        except BrokenPlugin as error:
            broken = {"name": name, "title": "", "needs": "", "state": f"broken: {error}"}
            rows.append({**broken, "options": {}, "card": None})
            continue
        card = cls.card
        options = {key: _plain(option.default) for key, option in plugin_options(cls).items()}
        needs = "weights" if card.needs_weights else ""
        row = {"name": name, "title": card.title, "needs": needs, "state": card.state}
        rows.append({**row, "options": options, "card": card})
    return rows


def _plain(value: Any) -> Any:
    return value if isinstance(value, bool | int | float | str | None) else str(value)


def _datasets(pattern: str) -> list[dict[str, Any]]:
    from nat2024.datasets import list_datasets, registered_dataset

    rows = []
    for name in list_datasets(pattern):
        facts = registered_dataset(name)
        row = {"name": name, "title": facts.title, "needs": "download", "state": facts.summary}
        rows.append(row)
    return rows


def _warn_of_two_opencvs() -> None:
    """Two OpenCV distributions overwrite each other's files; say so."""
    there = []
    for name in _OPENCV:
        try:
            there.append(f"{name} {importlib.metadata.version(name)}")
        except importlib.metadata.PackageNotFoundError:
            continue
    if len(there) > 1:
        both = ", ".join(there)
        click.echo(f"nat-bench: several OpenCV packages share one folder: {both}", err=True)
