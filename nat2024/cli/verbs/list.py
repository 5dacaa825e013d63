"""`nat-bench list`: what there is to run."""

import importlib.metadata
import textwrap
from typing import TYPE_CHECKING, Any

import click

from nat2024.cards import Card, describe_card, short_count
from nat2024.cli import options as shared
from nat2024.cli.output import print_json, print_table

if TYPE_CHECKING:
    from nat2024.errors import NatBenchError
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
@click.option("--card", "cards", is_flag=True, help="All that is known of each plugin.")
@shared.plugin_option
@shared.json_option
@shared.messages
def command(
    pattern: str,
    trackers: bool,
    enhancers: bool,
    datasets: bool,
    cards: bool,
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
    if datasets or (everything and not cards):
        found["datasets"] = _datasets(pattern)
    if not any(found.values()) and not set(pattern) & set("*?["):
        raise _unknown(pattern)
    _warn_of_two_opencvs()
    if as_json:
        print_json(found)
        return
    for kind, rows in found.items():
        if kind == "datasets":
            columns = ("name", "title", "needs", "state")
            lines = [[row[column] for column in columns] for row in rows]
            headings = [column.capitalize() for column in columns]
            print_table(headings, lines, title="Datasets", words=4)
        elif cards:
            for row in rows:
                _print_card(row)
        else:
            print_table(_HEADINGS, map(_cells, rows), title=kind.capitalize(), words=5)


_HEADINGS = ("Name", "Title", "State", "Weights", "Their licence", "Parameters", "MACs")


def _cells(row: dict[str, Any]) -> list[str]:
    """One line of the table of trackers or enhancers."""
    card: Card | None = row["card"]
    if card is None:
        return [row["name"], "", row["state"], "", "", "", ""]
    licences = dict.fromkeys(file.licence for file in card.weights)
    counts = [short_count(card.parameters), short_count(card.macs)]
    state = textwrap.shorten(card.state, 60, placeholder=" ...")  # --card shows all of it
    origin = row["weights"].partition(":")[0]
    return [row["name"], card.title, state, origin, ", ".join(licences), *counts]


def _print_card(row: dict[str, Any]) -> None:
    card: Card | None = row["card"]
    if card is None:
        click.echo(f"{row['name']}: {row['state']}\n")
        return
    click.echo(f"{row['name']}: {card.title}")
    facts = {"": (card.summary,), **describe_card(card)}
    options = tuple(f"{key}={value}" for key, value in row["options"].items())
    facts |= {"Options": options, "Weights at hand": (row["weights"],)}
    for heading, lines in facts.items():
        if heading and any(lines):
            click.echo(f"  {heading}:")
        for line in filter(None, lines):
            indent = "    " if heading else "  "
            click.echo(textwrap.fill(line, 98, initial_indent=indent, subsequent_indent=indent))
    click.echo()


def _plugins(kind: "Kind", pattern: str) -> list[dict[str, Any]]:
    from nat2024.errors import BrokenPlugin
    from nat2024.registry import list_plugins, load_plugin, plugin_options
    from nat2024.weights import describe_weights_at_hand

    rows: list[dict[str, Any]] = []
    for name in list_plugins(kind, pattern):
        try:
            cls = load_plugin(name, kind)
        except BrokenPlugin as error:
            broken = {"name": name, "title": "", "needs": "", "state": f"broken: {error}"}
            rows.append({**broken, "weights": "", "options": {}, "card": None})
            continue
        card = cls.card
        options = {key: _plain(option.default) for key, option in plugin_options(cls).items()}
        needs = "weights" if card.needs_weights else ""
        row = {"name": name, "title": card.title, "needs": needs, "state": card.state}
        weights = describe_weights_at_hand(name, card)
        rows.append({**row, "weights": weights, "options": options, "card": card})
    return rows


def _unknown(name: str) -> "NatBenchError":
    from nat2024.datasets import list_datasets
    from nat2024.errors import UnknownPlugin
    from nat2024.registry import list_enhancers, list_trackers
    from nat2024.types import closest

    names = [*list_trackers(), *list_enhancers(), *list_datasets()]
    return UnknownPlugin(f"nothing here is named {name!r}{closest(name, names)}")


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
