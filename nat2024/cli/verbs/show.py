"""`nat-bench show`: what runs did, in pictures."""

from collections.abc import Callable, Collection, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from nat2024.cli import options as shared
from nat2024.cli.scoring import Scored, Scoring, scoring_options

if TYPE_CHECKING:
    from nat2024.cli.plotting.jobs import Job
    from nat2024.cli.showing.scenes import Shown
    from nat2024.cli.showing.settings import Settings

FORMS = ("strip", "video", "frames")
_TELLING = 3


@click.command()
@scoring_options
@click.option(
    "--sequence",
    "sequences",
    multiple=True,
    metavar="A,B",
    help="Sequences to show; left out, those on which an enhancer changes most.",
)
@click.option(
    "--run",
    "runs",
    multiple=True,
    metavar="A,B",
    help="Runs, as their folders are called; left out, up to 6 that tell most.",
)
@shared.only_trackers_option
@shared.only_enhancers_option
@click.option(
    "--as",
    "forms",
    type=click.Choice(FORMS),
    multiple=True,
    default=("strip",),
    show_default=True,
    help="A strip of telling frames, a video, or each frame as PNG; repeatable.",
)
@click.option(
    "--out",
    type=click.Path(path_type=Path, file_okay=False),
    required=True,
    help="Folder that everything is written to.",
)
@click.option(
    "--format",
    "formats",
    default="pdf,png",
    show_default=True,
    metavar="F1,F2",
    help="Files of a strip: pdf, svg, png.",
)
@click.option(
    "--video-format",
    type=click.Choice(["webm", "mp4"]),
    default="webm",
    show_default=True,
    help='MP4 needs the extra "video".',
)
@click.option("--rate", default=30.0, show_default=True, help="Frames a second of a video.")
@click.option("--count", default=6, show_default=True, help="Frames of a strip.")
@click.option(
    "--frame",
    "frames",
    multiple=True,
    metavar="N,M",
    help="Frames of a strip, counted from 0; left out, the most telling ones.",
)
@click.option(
    "--range",
    "span",
    metavar="FIRST:LAST",
    help="Frames of a video or of single frames, counted from 0; left out, all.",
)
@click.option(
    "--enhanced/--original",
    default=None,
    help="Enhanced frames beside the original ones; left out, in strips only.",
)
@click.option(
    "--whole", is_flag=True, help="Whole frames with an inset in strips, else around the target."
)
@click.option("--inset/--no-inset", default=True, show_default=True, help="Magnify in videos.")
@shared.plugin_option
@shared.device_option
@shared.json_option
@shared.messages
def command(
    scoring: Scoring,
    sequences: tuple[str, ...],
    runs: tuple[str, ...],
    trackers: tuple[str, ...],
    enhancers: tuple[str, ...],
    forms: tuple[str, ...],
    plugins: tuple[str, ...],
    device: str,
    as_json: bool,
    **settings: Any,
) -> int:
    """Show what runs did: strips like the paper's Figure 6, videos, single frames.

    Boxes are solid with an enhancer and dashed without, the truth is white. With --json: `out`,
    `files` (each with path, form, format, dataset, sequence, runs, frames and why) and `remarks`.
    """
    from nat2024.cli.output import print_json
    from nat2024.cli.plotting.jobs import Job, Wanted, check_wanted
    from nat2024.cli.scoring import print_notes, score_with_datasets
    from nat2024.cli.showing.settings import check_runs, read_settings

    chosen = read_settings(forms, device, settings)
    shared.load_plugins(plugins)
    named = shared.read_names(runs)
    wanted = Wanted(*(shared.read_names(t) for t in (trackers, enhancers, (), sequences)))
    scored = score_with_datasets(scoring)
    print_notes(one.evaluation for one in scored)
    check_wanted(wanted, [one.evaluation for one in scored])
    check_runs(named, [one.evaluation for one in scored])
    files: list[dict[str, Any]] = []
    remarks: list[str] = []
    for one in scored:
        job = Job(one.evaluation, wanted)
        for name in _sequences(one, job, named, bool(wanted.sequences), remarks):
            files += _show(one, job, name, named, chosen, remarks)
    _finish(files, remarks)
    if as_json:
        print_json({"out": str(chosen.out), "files": files, "remarks": remarks})
    else:
        for about in files:
            click.echo(about["path"])
    return 0


def _sequences(
    one: Scored, job: "Job", runs: Collection[str], are_named: bool, remarks: list[str]
) -> list[str]:
    from nat2024.cli.showing.scenes import telling_sequences

    keep = job.keep & set(runs) if runs else job.keep
    if are_named:
        return [name for name in job.wanted.sequences if name in one.dataset]
    chosen = telling_sequences(one.evaluation, keep, _TELLING)
    if chosen:
        _say(
            remarks,
            f"{job.name}: showing {', '.join(chosen)}, which tell most; --sequence names others",
        )
    return chosen


def _show(
    one: Scored,
    job: "Job",
    name: str,
    runs: Collection[str],
    settings: "Settings",
    remarks: list[str],
) -> list[dict[str, Any]]:
    """Make all that is wanted of one sequence; gives what was written."""
    from nat2024.cli.progress import ProgressBar
    from nat2024.errors import FrameUnreadable

    shown = _prepare(one, job, name, runs, settings, remarks)
    if shown is None:
        return []
    made = []
    for form in settings.forms:
        with ProgressBar(settings.frames_of(form, shown)) as bar:
            try:
                found = _makers()[form](shown, one, settings, lambda bar=bar: bar(1, name))
            except FrameUnreadable as error:
                shown.remark(str(error))
                found = None
        if found is None:
            shown.remark(f"{job.name}, {name}: no frame can be read, no {form} is made")
            continue
        made += [{**about, "dataset": job.name, "sequence": name} for about in found]
    for line in shown.remarks:
        _say(remarks, line)
    return made


def _prepare(
    one: Scored,
    job: "Job",
    name: str,
    runs: Collection[str],
    settings: "Settings",
    remarks: list[str],
) -> "Shown | None":
    """What is shown of a sequence; None where no run has a result of it."""
    from dataclasses import replace

    from nat2024.cli.showing import scenes

    keep = job.keep & set(runs) if runs else job.keep
    chosen = scenes.telling_runs(one.evaluation, keep, name) if not runs else sorted(keep)
    kept = [r for r in one.evaluation.runs if r.run in chosen and name in r.sequences]
    if not kept:
        _say(remarks, f"{job.name}: no run has a result of {name}")
        return None
    there = [r.run for r in one.evaluation.runs if r.run in keep and name in r.sequences]
    if len(kept) < len(there):
        which = ", ".join(run.run for run in kept)
        _say(remarks, f"{name}: showing {which} of {len(there)} runs; --run names others")
    evaluation = replace(one.evaluation, runs=tuple(kept))
    evidence = scenes.look_into(evaluation, one.dataset, one.folder, name)
    named = [run for run in job.runs if run.run in evidence.tracks]
    looks = scenes.looks_of_runs([replace(run, note="") for run in named], job.runs)
    records = {
        run_name.enhancer: scores.manifest.enhancer
        for run_name in named
        for scores in kept
        if scores.run == run_name.run and scores.manifest and scores.manifest.enhancer
    }
    if not settings.enhances:
        records = {}
    # choosing a device takes a network library, so only where there is something to enhance
    device = shared.choose_device(settings.device) if records else "cpu"
    made, problems = scenes.enhancers_of(records, device)
    moments = scenes.moments_of(evaluation, evidence)
    return scenes.Shown(one.dataset[name], evidence, looks, moments, made, problems)


def _makers() -> "dict[str, Callable[..., list[dict[str, Any]] | None]]":
    return {"strip": _make_strip, "video": _make_video, "frames": _make_frames}


def _make_strip(
    shown: "Shown", one: Scored, settings: "Settings", step: Callable[[], object]
) -> list[dict[str, Any]] | None:
    from nat2024.cli.plotting.jobs import file_name
    from nat2024.cli.showing.pictures import draw_strip
    from nat2024.files import write_atomic
    from nat2024_reports.style import figure_bytes

    frames = settings.strip_frames(shown)
    title = f"{shown.sequence.name} ({one.evaluation.dataset})"
    figure = draw_strip(shown, frames, whole=settings.whole, title=title, on_frame=step)
    if figure is None:
        return None
    name = file_name(one.evaluation.dataset, "strip", shown.sequence.name)
    found = []
    for ending in settings.endings:
        path = settings.out / f"{name}{ending}"
        write_atomic(path, figure_bytes(figure, ending))
        why = [reason for _, reason, _ in frames]
        found.append(_about(path, "strip", shown, [frame for frame, _, _ in frames], why))
    return found


def _pictures(
    shown: "Shown", settings: "Settings", step: Callable[[], object]
) -> "Iterator[tuple[int, Any]]":
    from nat2024.cli.showing.pictures import film_frames

    for picture in film_frames(
        settings.for_video(shown), settings.video_frames(shown), inset=settings.inset
    ):
        step()
        yield picture


def _make_video(
    shown: "Shown", one: Scored, settings: "Settings", step: Callable[[], object]
) -> list[dict[str, Any]] | None:
    from nat2024.cli.plotting.jobs import file_name
    from nat2024.cli.showing.pictures import frame_size, write_video

    frame_size(shown)  # refuses a sequence without images
    name = file_name(one.evaluation.dataset, "video", shown.sequence.name)
    path = settings.out / f"{name}.{settings.video_format}"
    write_video(path, _pictures(shown, settings, step), settings.rate)
    return [_about(path, "video", shown, list(settings.video_frames(shown)), [])]


def _make_frames(
    shown: "Shown", one: Scored, settings: "Settings", step: Callable[[], object]
) -> list[dict[str, Any]] | None:
    from nat2024.cli.plotting.jobs import file_name
    from nat2024.cli.showing.pictures import frame_size, write_frames

    frame_size(shown)
    folder = settings.out / file_name(one.evaluation.dataset, "frames", shown.sequence.name)
    paths = write_frames(folder, _pictures(shown, settings, step))
    return [_about(path, "frames", shown, [int(path.stem)], []) for path in paths]


def _about(
    path: Path, form: str, shown: "Shown", frames: list[int], why: list[str]
) -> dict[str, Any]:
    return {
        "path": str(path),
        "form": form,
        "format": path.suffix[1:],
        "runs": list(shown.looks),
        "frames": frames,
        "why": why,
    }


def _say(remarks: list[str], line: str) -> None:
    import logging

    if line not in remarks:
        logging.getLogger("nat2024").info("%s", line)
        remarks.append(line)


def _finish(files: list[dict[str, Any]], remarks: list[str]) -> None:
    from nat2024.errors import UsageError

    if not files:
        msg = f"nothing to show: {'; '.join(remarks[-2:]) or 'no run is left'}"
        raise UsageError(msg)
