"""`nat-bench dataset stats`: the tables and figures of a dataset paper."""

import logging
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from nat2024.cli import options as shared
from nat2024.cli.describing import (
    choose_rules,
    columns_option,
    every_option,
    frame_bar,
    load,
    rule_options_option,
    rules_option,
)
from nat2024.cli.output import json_text, print_json, print_table

if TYPE_CHECKING:
    from nat2024.analysis import DatasetStatistics
    from nat2024.types import Dataset, Sequence
    from nat2024_reports.figures.dataset import FirstFrame

_THUMBNAIL = 400
"""Width of a first frame in the contact sheet in pixels."""

_log = logging.getLogger("nat2024")


@click.command()
@click.argument("name_or_path")
@click.option(
    "--out",
    type=click.Path(path_type=Path, file_okay=False),
    required=True,
    help="Folder for tables and figures; files of the same names are replaced.",
)
@shared.root_option
@shared.lenient_option
@columns_option
@rules_option
@rule_options_option
@every_option
@click.option("--no-pixels", is_flag=True, help="Leave out light, LAI, IV, UL, and the pictures.")
@click.option("--no-figures", is_flag=True, help="Tables alone.")
@shared.json_option
@shared.messages
def command(
    name_or_path: str,
    out: Path,
    root: Path | None,
    lenient: bool,
    columns: str | None,
    rules: str,
    rule_options: tuple[str, ...],
    every: int,
    no_pixels: bool,
    no_figures: bool,
    as_json: bool,
) -> int:
    """Write the tables and figures that a paper about a dataset needs.

    Lengths, box sizes and motion, where targets lie, light and how unevenly it falls, attributes
    and which of them go together, and first frames with the target's box in red. A sequence whose
    frames cannot be read is named and left out, with exit status 1.
    """
    from nat2024.analysis import dataset_statistics
    from nat2024.errors import DatasetIncomplete

    chosen = choose_rules(rules, rule_options)
    dataset = load(name_or_path, root, columns, lenient=lenient)
    distance = 0 if no_pixels else every
    with frame_bar(dataset, distance) as step:
        found = dataset_statistics(
            dataset,
            rules=chosen,
            every=distance,
            on_frame=step,
            on_failure=lambda name, error: _log.error("%s left out: %s", name, error),
        )
    whole, dataset = dataset, dataset.select(found.sequences.sequence)
    if not len(dataset):
        msg = f"{whole.name}: no sequence of it can be read"
        raise DatasetIncomplete(msg)
    document = _document(found)
    _write_tables(found, document, out)
    if not no_figures:
        _write_figures(found, dataset, out)
    if as_json:
        print_json(document)
    else:
        _print(document["summary"], found.name)
        click.echo(f"nat-bench: written to {out}", err=True)
    return 1 if len(dataset) < len(whole) else 0


def _document(found: "DatasetStatistics") -> dict[str, Any]:
    from dataclasses import asdict

    from nat2024.cli.output import rows_of

    return {
        "dataset": found.name,
        "rules": asdict(found.rules),
        "every": found.every,
        "summary": found.summary(),
        "sequences": rows_of(found.sequences),
        "attributes": rows_of(found.attributes),
        "co_occurrence": found.co_occurrence.to_dict(),
        "heat_map": found.heat_map.tolist(),
    }


def _write_tables(found: "DatasetStatistics", document: dict[str, Any], out: Path) -> None:
    from nat2024.analysis import attribute_meanings
    from nat2024.files import write_atomic
    from nat2024_reports import statistics_markdown

    for name in ("sequences", "attributes"):
        table = getattr(found, name)
        write_atomic(out / f"{name}.csv", table.to_csv(index=False, lineterminator="\n"))
    matrix = found.co_occurrence.to_csv(index_label="attribute", lineterminator="\n")
    write_atomic(out / "co_occurrence.csv", matrix)
    write_atomic(out / "statistics.json", json_text(document))
    meanings = attribute_meanings(found.rules)
    page = statistics_markdown(
        found.name, document["summary"], found.sequences, found.attributes, meanings
    )
    write_atomic(out / "statistics.md", page)


def _write_figures(found: "DatasetStatistics", dataset: "Dataset", out: Path) -> None:
    from nat2024_reports.figures import dataset as draw
    from nat2024_reports.style import save_figure

    table, rules = found.sequences, found.rules
    figures = {"lengths": draw.length_figure(table.set_index("sequence").frames)}
    if len(found.boxes):
        figures["boxes"] = draw.motion_figure(
            found.boxes,
            small_area=rules.small_area,
            fast_step=rules.fast_step,
            relative=rules.fast_step_relative,
        )
        aspect = float((table.width / table.height).median())
        figures["centres"] = draw.place_figure(found.heat_map, aspect)
    carried = found.co_occurrence.loc[lambda t: t.sum(axis=1) > 0]
    if len(carried):
        figures["co_occurrence"] = draw.co_occurrence_figure(carried[carried.index])
    if found.every:
        figures["light"] = draw.light_figure(found.light, uneven_light=rules.uneven_light)
        sheets = draw.contact_sheets([_first_frame(sequence) for sequence in dataset])
        names = [f"first_frames_{n}" if len(sheets) > 1 else "first_frames" for n in _count(sheets)]
        figures.update(zip(names, sheets, strict=True))
    for name, figure in figures.items():
        save_figure(figure, out, name)


def _count(sheets: list[Any]) -> range:
    return range(1, len(sheets) + 1)


def _first_frame(sequence: "Sequence") -> "FirstFrame":
    import cv2
    import numpy as np

    from nat2024_reports.figures.dataset import FirstFrame

    annotated = np.flatnonzero(np.isfinite(sequence.boxes).all(axis=1))
    frame = int(annotated[0]) if len(annotated) else 0
    image = sequence.image(frame)
    scale = min(1.0, _THUMBNAIL / image.shape[1])
    size = (round(image.shape[1] * scale), max(1, round(image.shape[0] * scale)))
    small = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    box = None
    if len(annotated):
        x, y, w, h = (sequence.boxes[frame] * scale).tolist()
        box = (x, y, w, h)
    return FirstFrame(sequence.name, np.ascontiguousarray(small[..., ::-1], np.uint8), box)


def _print(summary: dict[str, Any], name: str) -> None:
    columns = ("mean", "p5", "p50", "p95")
    rows = [
        [key.replace("_", " "), *(f"{values[column]:.3g}" for column in columns)]
        for key, values in summary.items()
        if isinstance(values, dict) and "mean" in values
    ]
    title = f"{name}: {summary['sequences']} sequences, {summary['frames']} frames"
    print_table(["", *columns], rows, title=title)
