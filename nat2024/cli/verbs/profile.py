"""`nat-bench profile`: what trackers and enhancers cost."""

import logging
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from nat2024.cli import options as shared
from nat2024.cli.output import print_json, print_table

if TYPE_CHECKING:
    from nat2024.engine import Combination
    from nat2024.profiling import Profile

log = logging.getLogger("nat2024")


@click.command()
@shared.trackers_option
@shared.enhancers_option
@shared.dataset_option
@shared.root_option
@click.option("--sequence", metavar="NAME", help="Whose frames are taken (default: the first).")
@click.option("--size", metavar="WxH", help="Scale frames to this size.")
@click.option("--frames", type=click.IntRange(1), default=60, show_default=True)
@click.option(
    "--warm-up",
    type=click.IntRange(1),
    default=5,
    show_default=True,
    help="Frames before them that are not measured.",
)
@shared.weights_option
@click.option(
    "--fresh-weights",
    is_flag=True,
    help="Fresh weights for networks that are given none: the cost is the same.",
)
@shared.opts_option
@shared.scope_option
@shared.device_option
@shared.backend_option("auto")
@shared.precision_option
@click.option("--threads", type=click.IntRange(1), default=1, show_default=True)
@shared.plugin_option
@click.option("--markdown", is_flag=True, help="Print the table as Markdown.")
@shared.json_option
@shared.messages
def command(
    trackers: tuple[str, ...],
    enhancers: tuple[str, ...],
    dataset: str | None,
    root: Path | None,
    sequence: str | None,
    size: str | None,
    frames: int,
    warm_up: int,
    weights: tuple[str, ...],
    fresh_weights: bool,
    opts: tuple[str, ...],
    scope: Any,
    device: str,
    backend: Any,
    precision: Any,
    threads: int,
    plugins: tuple[str, ...],
    markdown: bool,
    as_json: bool,
) -> int:
    """Measure parameters, multiply-accumulates, milliseconds, memory and frames per second.

    Every combination runs in a process of its own on the same frames, which are read before.
    Multiply-accumulates (MACs) are those of one frame: search crop, enhancer included.
    """
    from nat2024.datasets import load_dataset
    from nat2024.engine import combine
    from nat2024.profiling import FEWEST_FRAMES, profile

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
    if fresh_weights:
        combinations = [_with_fresh_weights(combination) for combination in combinations]
    chosen = load_dataset(shared.choose_dataset(dataset), root)
    measured = profile(
        combinations,
        chosen[sequence] if sequence else next(iter(chosen)),
        frames=frames,
        warm_up=warm_up,
        size=shared.read_size(size) if size else None,
        threads=threads,
        plugins=plugins,
    )
    if frames < FEWEST_FRAMES:
        log.warning("no frames per second: %d frames are too few, %d tell", frames, FEWEST_FRAMES)
    if as_json:
        print_json({"profiles": measured})
        return 0
    _print(measured, markdown)
    return 0


def _with_fresh_weights(combination: "Combination") -> "Combination":
    tracker, enhancer = combination.tracker, combination.enhancer
    if tracker.weights is None:
        tracker = replace(tracker, weights=False)
    if enhancer is not None and enhancer.weights is None:
        enhancer = replace(enhancer, weights=False)
    return replace(combination, tracker=tracker, enhancer=enhancer)


def _print(profiles: "list[Profile]", markdown: bool) -> None:
    headings = ["Run", "Parameters", "GMACs", "of enhancer", "Start ms", "Enhance ms", "Track ms"]
    headings += ["Frames/s", "Memory MB"]
    rows = [
        [
            one.run,
            f"{one.parameters:,}",
            "-" if one.macs is None else f"{one.macs / 1e9:.3f}",
            f"{one.enhancer_macs / 1e9:.3f}",
            f"{one.start_ms:.1f}",
            f"{one.enhance_ms:.1f}",
            f"{one.track_ms:.1f}",
            "-" if one.frames_per_second is None else f"{one.frames_per_second:.1f}",
            f"{one.added_memory_mb:.0f}",
        ]
        for one in profiles
    ]
    first = profiles[0]
    width, height = first.frame_size
    threads = f"{first.threads} thread{'s' if first.threads > 1 else ''}"
    title = f"{width}x{height}, {first.frames} frames, {first.device}, {threads}"
    if not markdown:
        print_table(headings, rows, title=title)
        return
    from nat2024_reports.formats.markdown import pipe_table

    click.echo(f"{title}\n\n{pipe_table(headings, rows)}", nl=False)
