"""`nat-bench run`: the main job."""

import logging
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from nat2024.cli import options as shared
from nat2024.cli.output import print_json
from nat2024.cli.progress import ProgressBar
from nat2024.cli.scoring import print_notes
from nat2024.cli.tables import print_scores
from nat2024.errors import NatBenchError, UsageError

if TYPE_CHECKING:
    from nat2024.engine import BenchmarkReport
    from nat2024.types import Dataset

log = logging.getLogger("nat2024")


@click.command()
@shared.trackers_option
@shared.enhancers_option
@shared.dataset_option
@shared.root_option
@shared.results_option
@shared.weights_option
@shared.opts_option
@shared.scope_option
@shared.device_option
@shared.backend_option("auto")
@shared.precision_option
@click.option(
    "--workers", type=int, default=1, show_default=True, help="Processes, or jobs of the cluster."
)
@click.option("--threads", type=int, default=1, show_default=True, help="Threads of each worker.")
@click.option(
    "--batch",
    type=int,
    default=1,
    show_default=True,
    help="Sequences that advance in one forward, where a tracker can.",
)
@click.option(
    "--cluster",
    metavar="local|slurm|tcp://HOST:PORT",
    help="Track on a Dask cluster instead of on this machine.",
)
@click.option("--shard", "part", metavar="I/N", help="Only one of N parts of like length, from 1.")
@click.option(
    "--timeout",
    type=click.FloatRange(0, min_open=True),
    metavar="SECONDS",
    help="Give up a sequence that takes a combination longer.",
)
@click.option(
    "--retries",
    type=click.IntRange(0),
    default=2,
    show_default=True,
    help="Try a sequence again whose worker died.",
)
@click.option(
    "--on-bad-frame",
    type=click.Choice(["error", "skip"]),
    default="error",
    show_default=True,
    help="A frame that cannot be read: fail its sequence, or repeat the last box and note it.",
)
@click.option(
    "--read-ahead",
    type=click.IntRange(0),
    default=4,
    show_default=True,
    help="Frames decoded ahead.",
)
@click.option("--sequences", metavar="A,B", help="Only these sequences.")
@shared.lenient_option
@shared.plugin_option
@shared.json_option
@shared.messages
def command(
    trackers: tuple[str, ...],
    enhancers: tuple[str, ...],
    dataset: str | None,
    root: Path | None,
    results: Path,
    weights: tuple[str, ...],
    opts: tuple[str, ...],
    scope: Any,
    device: str,
    backend: Any,
    precision: Any,
    workers: int,
    threads: int,
    batch: int,
    cluster: str | None,
    part: str | None,
    timeout: float | None,
    retries: int,
    on_bad_frame: Any,
    read_ahead: int,
    sequences: str | None,
    lenient: bool,
    plugins: tuple[str, ...],
    as_json: bool,
) -> int:
    """Track a dataset with every tracker and enhancer named.

    Finished sequences are kept and never tracked again, so the same command goes on where it was
    stopped. A sequence that fails is named, and the others go on.
    """
    from nat2024.engine import combine, run_benchmark

    shared.load_plugins(plugins)
    combinations = combine(
        shared.choose_trackers(trackers),
        enhancers,
        options=shared.read_plugin_options(opts),
        weights=shared.read_pairs(weights, "--weights"),
        scope=scope,
        device=shared.choose_device(device),
        backend=backend,
        precision=precision,
    )
    source = shared.choose_dataset(dataset)
    if cluster is not None:  # workers may run in other folders
        source, root = _absolute(source), root and root.absolute()
    chosen = _load(source, root, sequences, lenient)
    if part is not None:
        chosen = _part(chosen, part)
    with ProgressBar(len(combinations) * sum(map(len, chosen))) as progress:
        report = run_benchmark(
            combinations,
            chosen,
            results,
            workers=workers,
            threads=threads,
            batch=batch,
            cluster=cluster,
            shard=part or "",
            timeout=timeout,
            retries=retries,
            on_bad_frame=on_bad_frame,
            read_ahead=read_ahead,
            plugins=plugins,
            progress=progress,
        )
    _print(report, chosen, as_json)
    return 1 if report.failures else 0


def _load(source: str, root: Path | None, sequences: str | None, lenient: bool) -> "Dataset":
    from nat2024.datasets import load_dataset

    if sequences is None:
        return load_dataset(source, root, lenient=lenient)
    dataset = load_dataset(source, root, unannotated=True, lenient=lenient)
    return dataset.select(shared.read_names([sequences]))


def _absolute(source: str) -> str:
    from nat2024.datasets import list_datasets
    from nat2024.files import expand

    folder = expand(source)
    return str(folder.absolute()) if source not in list_datasets() and folder.exists() else source


def _part(dataset: "Dataset", text: str) -> "Dataset":
    from nat2024.engine import shard

    number, _, count = text.partition("/")
    if not (number.isdecimal() and count.isdecimal()):
        msg = f"--shard {text!r}: expected I/N, such as 2/8"
        raise UsageError(msg)
    part = shard(dataset, int(number), int(count))
    log.info("shard %s: %d of %d sequences", text, len(part), len(dataset))
    return part


def _print(report: "BenchmarkReport", dataset: "Dataset", as_json: bool) -> None:
    from nat2024.evaluation import evaluate

    if as_json:
        print_json(report)
        return
    done = f"{report.tracked} tracked, {report.skipped} finished before"
    if report.failures:
        done += f", {len(report.failures)} failed"
    log.info("%s: %s", report.folder, done)
    try:
        evaluations = [evaluate(report.folder, dataset, runs=report.runs)]
    except NatBenchError as error:  # what was tracked is kept, whatever scoring thinks of it
        log.error("not scored: %s", error)
        return
    print_notes(evaluations)
    print_scores(evaluations)
