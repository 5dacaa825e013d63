"""`nat-bench export`: results in other toolkits' layouts, foreign ones as ours, and networks."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from nat2024.cli import options as shared
from nat2024.cli.network_export import NetworkExport, export_network
from nat2024.cli.output import print_json, print_table

if TYPE_CHECKING:
    from nat2024.exporting import ExportReport

RESULT_FORMATS = ("pysot", "got10k", "pytracking", "bundle", "nat-bench")
"""As `nat2024.exporting.FORMATS`, which is imported only when it is used."""

NETWORK_FORMAT = "onnx"

_MOST_LINES = 20


@click.command()
@shared.stored_results_option
@click.option(
    "--format",
    "form",
    type=click.Choice([*RESULT_FORMATS, NETWORK_FORMAT]),
    required=True,
    help="Layout to write; nat-bench makes foreign results ours. onnx is for networks.",
)
@click.option("--tracker", metavar="NAME", help="Whose network is written, with --format onnx.")
@click.option("--enhancer", metavar="NAME", help="Likewise.")
@click.option(
    "--size",
    metavar="WxH",
    help="Size of the image that an enhancer's network is exported and checked with "
    "(default: 288x288).",
)
@shared.weights_option
@shared.opts_option
@click.option(
    "--out", type=click.Path(path_type=Path, file_okay=False), required=True, metavar="DIR"
)
@shared.dataset_option
@shared.root_option
@click.option("--run", "runs", multiple=True, metavar="RUN", help="Only this run; repeatable.")
@click.option(
    "--accept-restarts",
    is_flag=True,
    help="Take VOT short-term results for one-pass ones; rows without a box become NaN.",
)
@click.option(
    "--shift-origin",
    is_flag=True,
    help="Add (1, 1) px to runs whose first rows all lie (-1, -1) px from the annotation.",
)
@shared.json_option
@shared.messages
def command(
    results: Path,
    form: str,
    tracker: str | None,
    enhancer: str | None,
    size: str | None,
    weights: tuple[str, ...],
    opts: tuple[str, ...],
    out: Path,
    dataset: str | None,
    root: Path | None,
    runs: tuple[str, ...],
    accept_restarts: bool,
    shift_origin: bool,
    as_json: bool,
) -> int:
    """Write stored results in another layout, or a plugin's network as ONNX files.

    With --dataset results are held against it: what does not fit is left out and named, and the
    exit status is 1. With --json: `exported`, a list of format, dataset, loses and runs, each with
    run, tracker, enhancer, path, sequences, left_out and remarks.

    A network is written in parts, NAME-PART.onnx, each held against PyTorch. With --json: `parts`,
    a list of part, path, sha256, dynamic, inputs, outputs and difference.
    """
    if form == NETWORK_FORMAT or tracker or enhancer:
        wanted = NetworkExport(tracker, enhancer, form, size, weights, opts)
        return export_network(wanted, out, as_json=as_json)
    from nat2024.datasets import load_dataset
    from nat2024.exporting import export_results

    loaded = None
    if dataset is not None:
        loaded = load_dataset(dataset, root, unannotated=True, frameless=True)
    reports = [
        export_results(
            folder,
            form,
            out,
            dataset=loaded,
            runs=runs or None,
            accept_restarts=accept_restarts,
            shift_origin=shift_origin,
        )
        for folder in _folders(results, is_named=loaded is not None)
    ]
    _tell(reports)
    if as_json:
        print_json({"exported": reports})
    else:
        for report in reports:
            _print(report)
    return 0 if all(report.ok for report in reports) else 1


def _folders(results: Path, *, is_named: bool) -> list[Path]:
    """Folders of runs: the one that is given, or all that it holds where no dataset is named."""
    from nat2024.errors import DatasetNotFound, UsageError
    from nat2024.store import check_results, list_datasets, list_runs

    results = check_results(results)
    if is_named or list_runs(results):
        return [results]
    folders = list_datasets(results)
    if not folders:
        msg = f"{results}: holds no results"
        raise DatasetNotFound(msg)
    names = [folder.name for folder in folders]
    twice = [str(folder.relative_to(results)) for folder in folders if names.count(folder.name) > 1]
    if twice:
        msg = f"{results}: folders of one name: {', '.join(twice)}; name one of them"
        raise UsageError(msg)
    return folders


def _tell(reports: "list[ExportReport]") -> None:
    """Say on standard error what was left out, and what a reader must know."""
    import logging

    log = logging.getLogger("nat2024")
    for report in reports:
        if report.loses:
            log.info("%s: %s", report.format, report.loses)
        faults = [f"{run.run}: {why}" for run in report.runs for why in _faults(run.left_out)]
        for fault in faults[:_MOST_LINES]:
            log.error("left out: %s", fault)
        if len(faults) > _MOST_LINES:
            log.error("left out: %d more, --json names them all", len(faults) - _MOST_LINES)
        for run in report.runs:
            for remark in run.remarks:
                log.info("%s: %s", run.run, remark)


def _faults(left_out: dict[str, str]) -> list[str]:
    return [why if name in why else f"{name}: {why}" for name, why in left_out.items()]


def _print(report: "ExportReport") -> None:
    rows = [
        [run.run, run.tracker, run.enhancer, run.path or "-", str(run.sequences)]
        for run in report.runs
    ]
    headings = ["Run", "Tracker", "Enhancer", "Written to", "Sequences"]
    print_table(headings, rows, title=f"{report.dataset}; format {report.format}", words=4)
