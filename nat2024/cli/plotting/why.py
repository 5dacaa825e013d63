"""Figures that tell why: gain against light, and light over time with losses marked."""

from collections.abc import Iterator
from typing import TYPE_CHECKING

from nat2024.cli.plotting.details import TELLING, telling_sequences
from nat2024.cli.plotting.jobs import Drawing, Job, Remark, file_name

if TYPE_CHECKING:
    import pandas as pd

    from nat2024.evidence import Evidence, SequenceEvidence, TrackEvidence
    from nat2024_reports.figures.failures import Correlation, LossBand
    from nat2024_reports.figures.looks import Look

_SCORES = {"success_auc": "success (AUC)", "average_overlap": "average overlap"}


def draw_unevenness(job: Job) -> Iterator[Drawing | Remark]:
    """Gain of each enhancer against the light of the sequences."""
    from nat2024.evidence import gains_and_light
    from nat2024_reports.figures.curves import ranking_score

    kind = "unevenness"
    score = ranking_score(job.summary, "success")
    evidence = job.evidence(None)
    if evidence is None or not score:
        yield Remark(kind, f"{job.name}: no frames or no success score, so no gain against light")
        return
    table = gains_and_light(job.over(), evidence, score)
    if table.empty:
        why = "; ".join(evidence.notes) or "no run with an enhancer beside its tracker alone"
        yield Remark(kind, f"{job.name}: no gain against light, {why}")
        return
    for enhancer, rows in table.groupby("enhancer", sort=False):
        yield from _draw_unevenness_of(job, str(enhancer), rows, score)


def _draw_unevenness_of(
    job: Job, enhancer: str, rows: "pd.DataFrame", score: str
) -> Iterator[Drawing | Remark]:
    from nat2024.evidence import mean_gains
    from nat2024.measures import UNEVEN_LIGHT_STOPS
    from nat2024_reports.figures.failures import UNEVEN, gain_against_light_figure
    from nat2024_reports.figures.looks import looks_of

    chosen = [job.by_run[run] for run in dict.fromkeys(rows.run)]
    looks = looks_of(chosen, job.runs, by_tracker=True)
    named = {run.run: run.tracker for run in chosen}
    shown = rows.assign(tracker=rows.run.map(named))
    correlations = _correlations(rows)
    name = chosen[0].enhancer
    told = correlations[UNEVEN]
    words = f"Gain of {name} in {_SCORES[score]} against the light of each sequence"
    yield Drawing(
        name=file_name(job.name, "unevenness", enhancer),
        kind="unevenness",
        dataset=job.name,
        caption=job.caption(words, told.count, after=f"Unevenness of light: {told.text()}"),
        figure=gain_against_light_figure(
            shown,
            mean_gains(rows),
            correlations,
            {run.tracker: looks[run.run].color for run in chosen},
            title=f"{name} on {job.name}",
            gain=f"Gain in {_SCORES[score]}",
            uneven_from=UNEVEN_LIGHT_STOPS,
        ),
        table=job.with_names(rows),
    )
    yield Remark(
        "unevenness", f"{job.name}: gain of {name} with unevenness of light: {told.text()}"
    )


def _correlations(rows: "pd.DataFrame") -> "dict[str, Correlation]":
    from nat2024.evidence import correlate_gains
    from nat2024_reports.figures.failures import MEASURES, Correlation

    found = {}
    for measure in MEASURES:
        for one in correlate_gains(rows, measure).values():
            found[measure] = Correlation(one.value, one.low, one.high, one.pairs)
    return found


def draw_losses(job: Job) -> Iterator[Drawing | Remark]:
    """Light over time and when each run had its target, one figure a sequence."""
    names = list(job.wanted.sequences) or telling_sequences(job, TELLING)
    evidence = job.evidence(tuple(names))
    if evidence is None:
        yield Remark("losses", f"{job.name}: its dataset is not at hand, so no losses are drawn")
        return
    for note in evidence.notes:
        yield Remark("losses", f"{job.name}: {note}")
    for name in names:
        if name not in evidence:
            yield Remark("losses", f"{job.name}: no run has a result of {name}")
            continue
        yield _draw_losses_of(job, evidence, evidence[name])


def _draw_losses_of(job: Job, evidence: "Evidence", found: "SequenceEvidence") -> Drawing:
    from nat2024_reports.figures.failures import losses_figure
    from nat2024_reports.figures.looks import looks_of

    shown = [run for run in job.runs if run.run in found.tracks and run.run in job.keep]
    by_tracker = len({run.enhancer for run in shown if not run.is_plain}) <= 1
    looks: dict[str, Look] = looks_of(shown, job.runs, by_tracker=by_tracker)
    bands = [_band(found.tracks[run.run], evidence.loss_frames) for run in shown]
    light = light_table(found)
    words = (
        f"{'Overlap' if light is None else 'Light and the overlap'} of each run over {found.name} "
        f"(strong: large, empty: lost, cross: first loss of {evidence.loss_frames} frames without "
        "overlap)"
    )
    return Drawing(
        name=file_name(job.name, "losses", found.name),
        kind="losses",
        dataset=job.name,
        caption=job.caption(words, 1),
        figure=losses_figure(bands, looks, light, title=found.name),
        table=_loss_table(job, evidence, found),
    )


def _band(track: "TrackEvidence", loss_frames: int) -> "LossBand":
    from nat2024.analysis import lost_frames
    from nat2024_reports.figures.failures import LossBand

    lost = lost_frames(track.overlap, loss_frames=loss_frames)
    return LossBand(track.run, track.frames, track.overlap, lost, track.first_loss)


def light_table(found: "SequenceEvidence") -> "pd.DataFrame | None":
    """`frame, luminance, target_luminance, unevenness, target_unevenness`; None without images."""
    import pandas as pd

    light = found.light
    if light is None:
        return None
    return pd.DataFrame(
        {
            "frame": light.frames,
            "luminance": light.mean,
            "target_luminance": light.around / 255,
            "unevenness": light.spread,
            "target_unevenness": light.target_spread,
        }
    )


def _loss_table(job: Job, evidence: "Evidence", found: "SequenceEvidence") -> "pd.DataFrame":
    table = evidence.failures()
    rows = table[(table.sequence == found.name) & table.run.isin(job.keep)]
    return job.with_names(rows.reset_index(drop=True))
