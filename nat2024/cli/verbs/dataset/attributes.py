"""`nat-bench dataset attributes`: attributes computed from boxes and pixels."""

import csv
import io
import logging
from pathlib import Path
from typing import TYPE_CHECKING

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
from nat2024.cli.output import print_json, print_table

log = logging.getLogger("nat2024")

if TYPE_CHECKING:
    from nat2024.analysis import ComputedAttributes
    from nat2024.types import Dataset

_NUMBERS = {
    "largest_step": "Largest step",
    "smallest_area": "Smallest area",
    "grey_around_target": "Grey around target",
    "light_spread": "Light spread",
    "light_spread_around_target": "Spread around target",
}


@click.command()
@click.argument("name_or_path")
@shared.root_option
@shared.lenient_option
@columns_option
@rules_option
@rule_options_option
@every_option
@click.option("--no-pixels", is_flag=True, help="Boxes alone: no LAI, IV and UL, and fast.")
@click.option("--per-frame", is_flag=True, help="The frames that carry each attribute, too.")
@click.option(
    "--out",
    type=click.Path(path_type=Path, dir_okay=False),
    help="Write to a .csv or .json file.",
)
@shared.json_option
@shared.messages
def command(
    name_or_path: str,
    root: Path | None,
    lenient: bool,
    columns: str | None,
    rules: str,
    rule_options: tuple[str, ...],
    every: int,
    no_pixels: bool,
    per_frame: bool,
    out: Path | None,
    as_json: bool,
) -> int:
    """Compute attributes: FM, LR, SV, ARC, FOC, size bins, LAI, IV, UL.

    They are marked as computed, stand beside published labels and are compared with them; no
    label is replaced. LAI, IV and UL (uneven light) look at pixels. A sequence whose frames cannot
    be read is named and left out, with exit status 1.
    """
    from nat2024.analysis import attribute_document, computed_attributes
    from nat2024.errors import FrameUnreadable, UsageError

    if out is not None and out.suffix not in (".csv", ".json"):
        msg = f"--out {out}: name a file that ends in .csv or .json"
        raise UsageError(msg)
    if per_frame and out is None and not as_json:
        msg = "--per-frame needs --out FILE or --json"
        raise UsageError(msg)
    chosen = choose_rules(rules, rule_options)
    dataset = load(name_or_path, root, columns, lenient=lenient)
    with frame_bar(dataset, 0 if no_pixels else every) as step:
        computed = {}
        for sequence in dataset:
            try:
                computed[sequence.name] = computed_attributes(
                    sequence, rules=chosen, pixels=not no_pixels, every=every, on_frame=step
                )
            except FrameUnreadable as error:
                log.error("%s left out: %s", sequence.name, error)
    failed = len(dataset) - len(computed)
    dataset = dataset.select(computed)
    if out is not None:
        _write(out, dataset, computed, per_frame)
    if as_json:
        print_json(attribute_document(dataset, computed, per_frame=per_frame))
    else:
        _print(dataset, computed)
    return 1 if failed else 0


def _write(
    out: Path, dataset: "Dataset", computed: "dict[str, ComputedAttributes]", per_frame: bool
) -> None:
    from nat2024.analysis import attribute_document, attribute_rows, frame_rows
    from nat2024.cli.output import json_text
    from nat2024.files import write_atomic

    if out.suffix == ".json":
        write_atomic(out, json_text(attribute_document(dataset, computed, per_frame=per_frame)))
        return
    text = io.StringIO()
    rows = frame_rows(dataset, computed) if per_frame else attribute_rows(dataset, computed)
    csv.writer(text, lineterminator="\n").writerows(rows)
    write_atomic(out, text.getvalue())


def _print(dataset: "Dataset", computed: "dict[str, ComputedAttributes]") -> None:
    from nat2024.analysis import attribute_meanings, label_agreement, published_attributes

    numbers = [n for n in _NUMBERS if any(n in found.measured for found in computed.values())]
    rows = [
        [
            sequence.name,
            " ".join(sorted(published_attributes(sequence))) or "-",
            " ".join(a for a, carried in computed[sequence.name].labels.items() if carried) or "-",
            *(_number(computed[sequence.name].measured.get(name)) for name in numbers),
        ]
        for sequence in dataset
    ]
    headings = ["Sequence", "Published", "Computed", *(_NUMBERS[name] for name in numbers)]
    print_table(headings, rows, title=f"{dataset.name}: attributes", words=3)
    for found in label_agreement(dataset, computed):
        equal = found.both + found.neither
        click.echo(f"{found.attribute}: computed as published in {equal} of {found.sequences}")
    first = next(iter(computed.values()), None)
    carried = {name for found in computed.values() for name in found.attributes}
    for name, meaning in attribute_meanings(first.rules).items() if first else ():
        if name in carried:
            click.echo(f"{name}, computed: {meaning}")


def _number(value: float | None) -> str:
    return "-" if value is None or value != value else f"{value:.2f}"
