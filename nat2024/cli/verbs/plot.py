"""`nat-bench plot`: scores as a paper draws them."""

import functools
from collections.abc import Collection, Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from nat2024.cli import options as shared
from nat2024.cli.output import print_json
from nat2024.cli.scoring import Scoring, print_notes, score, scoring_options

if TYPE_CHECKING:
    from nat2024.cli.plotting.jobs import Drawing, Job, Remark, Wanted
    from nat2024.evaluation import Evaluation
    from nat2024.evidence import Evidence
    from nat2024.types import Dataset

KINDS = (
    "curves",
    "attributes",
    "radar",
    "gains",
    "light",
    "error",
    "speed",
    "unevenness",
    "losses",
)
_FORMATS = ("pdf", "svg", "png")


@click.command()
@scoring_options
@click.option(
    "--kind",
    "kinds",
    type=click.Choice([*KINDS, "all"]),
    multiple=True,
    default=("all",),
    show_default=True,
    help="What to draw; repeatable.",
)
@click.option(
    "--out",
    type=click.Path(path_type=Path, file_okay=False),
    required=True,
    help="Folder that the figures are written to.",
)
@click.option(
    "--format",
    "formats",
    default=",".join(_FORMATS),
    show_default=True,
    metavar="F1,F2",
    help="Files of each figure; its numbers lie beside them as .csv.",
)
@shared.only_trackers_option
@shared.only_enhancers_option
@click.option(
    "--attribute",
    "attributes",
    multiple=True,
    metavar="A,B",
    help="Only these attributes or categories.",
)
@click.option(
    "--sequence",
    "sequences",
    multiple=True,
    metavar="A,B",
    help="Sequences whose errors are drawn; left out, the most telling ones.",
)
@shared.computed_attributes_option
@shared.json_option
@shared.messages
def command(
    scoring: Scoring,
    kinds: tuple[str, ...],
    out: Path,
    formats: str,
    trackers: tuple[str, ...],
    enhancers: tuple[str, ...],
    attributes: tuple[str, ...],
    sequences: tuple[str, ...],
    computed_attributes: bool,
    as_json: bool,
) -> None:
    """Draw stored results as a paper does, with the numbers beside each figure.

    Kinds "unevenness" (gain against light) and "losses" look at frames, and keep what they saw
    beside the results.

    What cannot be drawn is said, and the rest is made.
    """
    from nat2024.cli.plotting.jobs import Wanted, check_wanted

    endings = _read_formats(formats)
    named = (trackers, enhancers, attributes, sequences)
    wanted = Wanted(*(shared.read_names(texts) for texts in named))
    evaluations = score(scoring, computed_attributes=computed_attributes)
    print_notes(evaluations)
    check_wanted(wanted, evaluations)
    chosen = KINDS if "all" in kinds else tuple(dict.fromkeys(kinds))
    made = _draw([_job(scoring, one, wanted) for one in evaluations], chosen)
    files, remarks = _write(made, out, endings)
    _refuse_nothing(files, remarks, out)
    if as_json:
        print_json({"out": str(out), "files": files, "remarks": remarks})
    else:
        captions = {about["figure"]: about["caption"] for about in files}
        for name, caption in captions.items():
            click.echo(f"{name}: {caption}")
        click.echo(f"{out}: {len(captions)} figures, {len(files)} files")


def _read_formats(text: str) -> tuple[str, ...]:
    from nat2024.errors import UsageError

    formats = shared.read_names([text])
    unknown = [name for name in formats if name not in _FORMATS]
    if unknown or not formats:
        msg = f"--format {text!r}: expected some of {', '.join(_FORMATS)}, separated by commas"
        raise UsageError(msg)
    return tuple(f".{name}" for name in formats)


def _job(scoring: Scoring, evaluation: "Evaluation", wanted: "Wanted") -> "Job":
    from nat2024.cli.plotting.jobs import Job

    @functools.cache  # so that remarks on it are made once
    def dataset() -> "Dataset | None":
        from nat2024.datasets import load_dataset
        from nat2024.errors import NatBenchError
        from nat2024.evaluation import dataset_of_runs
        from nat2024.store import dataset_folder

        lenient = scoring.lenient
        try:
            if scoring.dataset is not None:
                return load_dataset(
                    scoring.dataset,
                    scoring.root,
                    unannotated=True,
                    frameless=True,
                    lenient=lenient,
                )
            folder = dataset_folder(scoring.results, evaluation.dataset)
            return dataset_of_runs(folder, lenient=lenient, frameless=True)
        except NatBenchError:
            return None

    def gathered(over: "Evaluation", names: "Collection[str] | None") -> "Evidence | None":
        from nat2024.cli.progress import ProgressBar
        from nat2024.evidence import gather

        found = dataset()
        if found is None:
            return None
        kept = found if names is None else found.select(n for n in names if n in found)
        with ProgressBar(0) as bar:
            return gather(
                over,
                kept,
                scoring.results,
                enhance=False,
                on_frame=lambda: bar(1, evaluation.dataset),
            )

    return Job(evaluation, wanted, dataset, gathered)


def _draw(jobs: "list[Job]", kinds: Iterable[str]) -> "Iterator[Drawing | Remark]":
    from nat2024.cli.plotting import details, scores, why

    by_kind = {
        "curves": scores.draw_curves,
        "attributes": scores.draw_attributes,
        "radar": scores.draw_radar,
        "gains": scores.draw_gains,
        "error": details.draw_errors,
        "speed": details.draw_speed,
        "unevenness": why.draw_unevenness,
        "losses": why.draw_losses,
    }
    for kind in kinds:
        if kind == "light":
            yield from details.draw_light(jobs)
            continue
        for job in jobs:
            yield from by_kind[kind](job)


def _write(
    made: "Iterable[Drawing | Remark]", out: Path, endings: tuple[str, ...]
) -> "tuple[list[dict[str, Any]], list[Remark]]":
    """Write every figure and its numbers as soon as it is drawn; tell of the files."""
    import logging

    from nat2024.cli.plotting.jobs import Remark
    from nat2024.files import write_atomic
    from nat2024_reports.style import figure_bytes

    log = logging.getLogger("nat2024")
    files: list[dict[str, Any]] = []
    remarks: list[Remark] = []
    taken: set[str] = set()
    for one in made:
        if isinstance(one, Remark):
            log.info("%s", one.text)
            remarks.append(one)
            continue
        name = _free(one.name, taken)
        about = {"figure": name, "kind": one.kind, "dataset": one.dataset, "caption": one.caption}
        content: dict[str, str | bytes] = {
            ending: figure_bytes(one.figure, ending) for ending in endings
        }
        content[".csv"] = one.table.to_csv(index=False, lineterminator="\n")
        for ending, data in content.items():
            path = out / f"{name}{ending}"
            write_atomic(path, data)
            files.append({"path": str(path), "format": ending[1:], **about})
    return files, remarks


def _free(name: str, taken: set[str]) -> str:
    """A name that no other figure of this call has, on file systems that ignore case too."""
    free, number = name, 1
    while free.lower() in taken:
        number += 1
        free = f"{name}_{number}"
    taken.add(free.lower())
    return free


def _refuse_nothing(files: list[dict[str, Any]], remarks: "list[Remark]", out: Path) -> None:
    from nat2024.errors import UsageError

    if not files:
        reasons = "; ".join(remark.text for remark in remarks[:3]) or "no run is left"
        msg = f"nothing to draw in {out}: {reasons}"
        raise UsageError(msg)
