"""`nat-bench track`: one's own footage."""

import logging
from contextlib import ExitStack
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from nat2024.cli import options as shared
from nat2024.cli.output import json_text, print_json, print_table
from nat2024.errors import UsageError

if TYPE_CHECKING:
    from nat2024.live import LiveFrame, LiveSource, LiveSummary
    from nat2024.types import Box, Boxes, Image

log = logging.getLogger("nat2024")

_ERROR_FILES = tuple(f"center_error.{ending}" for ending in ("pdf", "png", "csv"))
_LATER_FILES = ("overlay.webm", "summary.json", *_ERROR_FILES)
"""What a run writes at its end, or does not write."""


@click.command()
@click.argument("source")
@click.option(
    "--box", "box_text", metavar="X,Y,W,H", help="The target in the first frame, in pixels."
)
@click.option("--tracker", metavar="NAME", help=f"Left out: {shared.DEFAULT_TRACKER}.")
@click.option("--enhancer", default="none", show_default=True, metavar="NAME")
@click.option(
    "--out",
    type=click.Path(path_type=Path, file_okay=False),
    default=Path("tracked"),
    show_default=True,
    help="Folder for boxes, times, overlay video and figure.",
)
@click.option("--start", type=click.IntRange(0), default=0, help="Frames left out at the start.")
@click.option("--max-frames", type=click.IntRange(1), help="Stop after so many frames.")
@click.option(
    "--skip-late-frames",
    is_flag=True,
    help="Drop frames that come while the method is busy, as on board.",
)
@click.option(
    "--fps",
    type=click.FloatRange(0, min_open=True),
    help="Frames a second of the source; left out, what it says (a folder: 30).",
)
@click.option(
    "--reference",
    type=click.Path(path_type=Path, exists=True, dir_okay=False),
    help="Reference boxes, a line for each frame of the source.",
)
@click.option("--no-video", is_flag=True, help="Write no overlay video.")
@shared.weights_option
@shared.opts_option
@shared.scope_option
@shared.device_option
@shared.backend_option("auto")
@shared.precision_option
@click.option("--threads", type=click.IntRange(1), help="Threads of the networks.")
@shared.plugin_option
@shared.json_option
@shared.messages
def command(
    source: str,
    box_text: str | None,
    tracker: str | None,
    enhancer: str,
    out: Path,
    start: int,
    max_frames: int | None,
    skip_late_frames: bool,
    fps: float | None,
    reference: Path | None,
    no_video: bool,
    weights: tuple[str, ...],
    opts: tuple[str, ...],
    scope: Any,
    device: str,
    backend: Any,
    precision: Any,
    threads: int | None,
    plugins: tuple[str, ...],
    as_json: bool,
) -> int:
    """Track one object through SOURCE: a video, a folder of images, a camera's number or a URL.

    Writes boxes.txt, frames.csv, overlay.webm and summary.json; with --reference the centre
    location error as a figure too. Ctrl-C ends it and keeps everything. Where --box is left out,
    the reference box of the first frame is taken.
    """
    from nat2024.boxes import read_boxes
    from nat2024.engine import combine
    from nat2024.files import write_atomic
    from nat2024.live import open_source, summarise

    shared.load_plugins(plugins)
    truth = read_boxes(reference) if reference else None
    box = _first_box(box_text, truth, start)
    [combination] = combine(
        shared.choose_trackers((tracker,) if tracker else ()),
        [enhancer],
        options=shared.read_plugin_options(opts),
        weights=shared.read_pairs(weights, "--weights"),
        scope=scope,
        device=shared.choose_device(device),
        backend=backend,
        precision=precision,
    )
    if threads:
        import torch

        torch.set_num_threads(threads)
    method, _ = combination.create()
    with open_source(source, rate=fps) as opened:
        frames = _follow(
            opened,
            method,
            box,
            truth,
            out,
            label=combination.run,
            video=not no_video,
            start=start,
            max_frames=max_frames,
            arrival="live" if skip_late_frames else "wait",
        )
    summary = summarise(frames, truth)
    document = {"source": opened.title, "run": combination.run, "fps": opened.rate}
    document |= {**asdict(summary), "out": str(out)}
    write_atomic(out / "summary.json", json_text(document))
    if truth is not None:
        _draw_errors(frames, truth, out, combination.run)
    if as_json:
        print_json(document)
    else:
        _print(opened, combination.run, summary)
    return 0


def _first_box(text: str | None, truth: "Boxes | None", start: int) -> "Box":
    import numpy as np

    if text is None:
        if truth is None or start >= len(truth):
            msg = "--box X,Y,W,H is needed: the target in the first frame"
            raise UsageError(msg)
        first: Box = truth[start]
        return first
    try:
        box = np.array([float(number) for number in text.split(",")])
    except ValueError:
        box = np.empty(0)
    if box.shape != (4,):
        msg = f"--box {text!r}: expected X,Y,W,H, four numbers with commas"
        raise UsageError(msg)
    return box


def _follow(
    source: "LiveSource",
    method: Any,
    box: "Box",
    truth: "Boxes | None",
    out: Path,
    *,
    label: str,
    video: bool,
    **how: Any,
) -> "list[LiveFrame]":
    """Track, record and draw; Ctrl-C ends it as the end of the source does."""
    from nat2024.cli.progress import ProgressBar
    from nat2024.live import Film, Recorder, follow

    frames: list[LiveFrame] = []
    total = how["max_frames"] or (source.count - how["start"] if source.count else 0)
    with ExitStack() as stack:
        for name in _LATER_FILES:
            (out / name).unlink(missing_ok=True)  # an earlier run's would pass for this one's
        recorder = stack.enter_context(Recorder(out))
        film = stack.enter_context(Film(out / "overlay.webm", source.rate))
        progress = stack.enter_context(ProgressBar(total))
        try:
            for frame in follow(source, method, box, **how):
                recorder.write(frame)
                frames.append(replace(frame, image=None))  # pixels are not kept
                progress(1, label)
                if video:
                    film.write(_drawn(frame, truth, label))
        except KeyboardInterrupt:
            log.info("stopped after %d frames; everything up to there is kept", len(frames))
    return frames


def _drawn(frame: "LiveFrame", truth: "Boxes | None", label: str) -> "Image | None":
    from nat2024_reports.overlays import draw_boxes

    if frame.image is None:
        return None
    known = None if truth is None or frame.index >= len(truth) else truth[frame.index]
    return draw_boxes(frame.image, frame.box, known, (label, f"frame {frame.index}"))


def _draw_errors(frames: "list[LiveFrame]", truth: "Boxes", out: Path, label: str) -> None:
    import numpy as np

    from nat2024.files import write_atomic
    from nat2024.live import center_errors
    from nat2024_reports.figures.tracking import center_error_figure
    from nat2024_reports.style import save_figure

    numbers = np.array([frame.index for frame in frames])
    errors = center_errors(frames, truth)
    save_figure(center_error_figure(numbers, errors, label), out, "center_error")
    rows = [f"{number},{error:.6f}\n" for number, error in zip(numbers, errors, strict=True)]
    write_atomic(out / "center_error.csv", "frame,center_error\n" + "".join(rows))


def _print(source: "LiveSource", label: str, summary: "LiveSummary") -> None:
    headings = ["Run", "Frames", "Skipped", "Read ms", "Enhance ms", "Track ms"]
    row = [label, str(summary.frames), str(summary.skipped)]
    row += [f"{ms:.1f}" for ms in (summary.read_ms, summary.enhance_ms, summary.track_ms)]
    headings += ["Frames/s", "Frames/s without reading"]
    row += [f"{r:.1f}" for r in (summary.frames_per_second, summary.method_frames_per_second)]
    if summary.compared:
        headings += ["Precision 20 px", "Mean error px"]
        row += [f"{summary.precision_20:.3f}", f"{summary.mean_center_error:.1f}"]
    print_table(headings, [row], title=source.title)
