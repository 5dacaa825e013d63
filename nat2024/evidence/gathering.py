"""Gathering evidence: boxes of all runs, and the frames that tell why."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from nat2024.analysis import LOSS_FRAMES, LightTrace, Moment, choose_moments, find_failure
from nat2024.errors import BoxFileError, FrameUnreadable
from nat2024.evaluation import Evaluation, RunScores
from nat2024.evaluation.gains import paired_runs
from nat2024.evidence.enhancers import RunEnhancer
from nat2024.evidence.keeping import open_keeper
from nat2024.evidence.looking import Looker
from nat2024.evidence.records import Evidence, SequenceEvidence, Thumbnail, TrackEvidence
from nat2024.metrics import center_error, overlap
from nat2024.store import Run, dataset_folder, list_runs
from nat2024.types import Boxes, Dataset, Sequence


@dataclass(slots=True)
class _Job:
    """What holds for all sequences of one call."""

    folder: Path
    stored: Mapping[str, Run]
    runs: Mapping[str, RunScores]
    pairs: tuple[tuple[str, str], ...]
    enhancers: Mapping[str, RunEnhancer]
    frames: bool
    every: int | None
    loss_frames: int
    store: bool
    on_frame: Callable[[], object]
    unreadable: dict[str, set[str]] = field(default_factory=dict)
    without_images: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def note(self, line: str) -> None:
        """Add a note once."""
        if line not in self.notes:
            self.notes.append(line)


def gather(
    evaluation: Evaluation,
    dataset: Dataset,
    results: str | Path,
    *,
    frames: bool = True,
    enhance: bool = True,
    every: int | None = None,
    loss_frames: int = LOSS_FRAMES,
    store: bool = True,
    on_frame: Callable[[], object] | None = None,
) -> Evidence:
    """Gather what tells why runs score as they do; the package explains what comes out.

    What cannot be had (no images, a frame that cannot be decoded, an enhancer that cannot be made
    again) is left out and named in `Evidence.notes`; the rest is made.

    Args:
        evaluation: of the runs that are wanted.
        dataset: the same that was evaluated.
        results: the folder that was evaluated.
        frames: look at frames; without, there is no light and are no thumbnails.
        enhance: make enhancers again, to measure over-enhancement where targets are lost.
        every: distance of the frames whose light is measured; None takes at most 60 of a sequence.
        loss_frames: frames without overlap in a row that make a loss.
        store: keep what took long in `RESULTS/DATASET/.evidence/`.
        on_frame: called after each frame that was decoded, to show progress.

    Raises:
        DatasetNotFound: there are no results of this dataset.
    """
    folder = dataset_folder(results, dataset.name)
    job = _Job(
        folder=folder,
        stored={run.name: run for run in list_runs(folder)},
        runs={run.run: run for run in evaluation.runs},
        pairs=tuple((run.run, base.run) for run, base in paired_runs(evaluation)),
        enhancers={},
        frames=frames,
        every=every,
        loss_frames=loss_frames,
        store=store and folder.is_dir(),
        on_frame=on_frame or _nothing,
    )
    if frames and store and not job.store:
        job.note("nothing that is seen is kept: the results lie in an archive")
    if enhance and frames:
        job.enhancers = {name: RunEnhancer(run.manifest) for name, run in job.runs.items()}
    wanted = {name for run in evaluation.runs for name in run.sequences}
    found = tuple(_look_into(job, sequence) for sequence in dataset if sequence.name in wanted)
    return Evidence(dataset.name, found, tuple(_all_notes(job, len(found))), loss_frames)


def _nothing() -> None:
    """No progress is asked for."""


def _look_into(job: _Job, sequence: Sequence) -> SequenceEvidence:
    truth = known_truth(sequence)
    tracks: dict[str, TrackEvidence] = {}
    for run in job.runs.values():
        if sequence.name not in run.sequences:
            continue
        try:
            tracks[run.run] = _track(job, run, sequence, truth)
        except BoxFileError as error:  # it has changed since it was evaluated
            job.note(str(error))
    found = SequenceEvidence(sequence.name, len(truth), truth, tracks)
    return _with_frames(job, sequence, found) if job.frames and tracks else found


def known_truth(sequence: Sequence) -> Boxes:
    """One row a frame, NaN where there is no target to compare with.

    That is where a row is not four finite numbers with w, h > 0, or is flagged invisible.
    """
    boxes = np.array(sequence.boxes, dtype=np.float64)
    with np.errstate(invalid="ignore"):
        bad = ~np.isfinite(boxes).all(axis=1) | (boxes[:, 2:] <= 0).any(axis=1)
    if sequence.visible is not None:
        bad |= ~sequence.visible
    boxes[bad] = np.nan
    return boxes


def _track(job: _Job, run: RunScores, sequence: Sequence, truth: Boxes) -> TrackEvidence:
    given = job.stored[run.run].boxes(sequence.name)
    rows = len(truth)
    boxes = np.full((rows, 4), np.nan)  # a result that is too short found nothing in the rest
    boxes[: min(rows, len(given))] = given[:rows]
    if run.sequences[sequence.name].rows < rows and sequence.keyframes is None:
        rows = run.sequences[sequence.name].rows  # the protocol cut both
    frames = np.arange(rows) if sequence.keyframes is None else sequence.keyframes
    boxes, target = boxes[frames], truth[frames]
    usable = np.isfinite(boxes).all(axis=1)
    overlaps = overlap(boxes, target)
    overlaps[~usable & np.isfinite(target).all(axis=1)] = 0.0
    errors = center_error(boxes, target)
    failure = find_failure(overlaps, errors, loss_frames=job.loss_frames)
    return TrackEvidence(
        run.run, run.tracker, run.enhancer, frames, boxes, overlaps, errors, failure
    )


def _with_frames(job: _Job, sequence: Sequence, found: SequenceEvidence) -> SequenceEvidence:
    def unreadable(error: FrameUnreadable) -> None:
        job.unreadable.setdefault(sequence.name, set()).add(str(error))

    keeper = open_keeper(job.folder if job.store else None, sequence.name)
    looker = Looker(sequence, found.truth, keeper, job.on_frame, unreadable)
    light: LightTrace | None = None
    if looker.has_images():
        light = looker.light(job.every)
    if light is None:
        job.unreadable.pop(sequence.name, None)
        job.without_images.append(sequence.name)
        return found
    tracks = {
        run: replace(track, at_loss=looker.at_loss(track, job.enhancers.get(run)))
        for run, track in found.tracks.items()
    }
    for enhancer in job.enhancers.values():
        if enhancer.problem and enhancer.record:
            title = enhancer.record.title
            job.note(f"no over-enhancement by {title} is measured: {enhancer.problem}")
    thumbnails = _thumbnails(looker, tracks, job.pairs)
    error = keeper.save()
    if error is not None:
        job.note(f"evidence is not kept: {error}")
    return replace(found, tracks=tracks, light=light, thumbnails=thumbnails)


def _thumbnails(
    looker: Looker, tracks: Mapping[str, TrackEvidence], pairs: Iterable[tuple[str, str]]
) -> tuple[Thumbnail, ...]:
    pictures = []
    for frame, moment in telling_frames(tracks, pairs):
        picture = looker.thumbnail(frame, moment, list(tracks.values()))
        if picture is not None:
            pictures.append(picture)
    return tuple(pictures)


def telling_frames(
    tracks: Mapping[str, TrackEvidence], pairs: Iterable[tuple[str, str]]
) -> list[tuple[int, Moment]]:
    """Numbers of the frames that tell most about these runs of one sequence, and why.

    `pairs` are (run with an enhancer, the same tracker alone), as in `choose_moments`.
    """
    longest = max(tracks.values(), key=lambda track: len(track.frames))
    moments = choose_moments(
        {run: track.overlap for run, track in tracks.items()},
        pairs,
        {run: track.failure.first_loss for run, track in tracks.items()},
    )
    return [(int(longest.frames[moment.row]), moment) for moment in moments]


def _all_notes(job: _Job, count: int) -> list[str]:
    notes = list(job.notes)
    if job.without_images:
        names = _few(job.without_images)
        which = "any sequence" if len(job.without_images) == count else names
        notes.append(f"no readable images of {which}: no light and no thumbnails")
    for name, errors in job.unreadable.items():
        unit = "frame" if len(errors) == 1 else "frames"
        notes.append(f"{name}: {len(errors)} {unit} cannot be read, such as {min(errors)}")
    return notes


def _few(names: list[str], count: int = 5) -> str:
    return ", ".join(names[:count]) + (", ..." if len(names) > count else "")
