"""Figures beyond scores: errors over time, speed, light levels."""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from nat2024.cli.plotting.jobs import Drawing, Job, Remark, file_name
from nat2024.types import Floats

if TYPE_CHECKING:
    import pandas as pd

    from nat2024_reports.figures.looks import NamedRun, View

TELLING = 4
"""Sequences whose errors are drawn where none is named."""

_SCORE_LABELS = {"success_auc": "Success (AUC)", "average_overlap": "Average overlap"}


def draw_errors(job: Job) -> Iterator[Drawing | Remark]:
    """Centre location error over time, one figure a sequence."""
    scored = [name for name in job.wanted.sequences if _runs_with(job, name)]
    for name in job.wanted.sequences:
        if name not in scored:
            yield Remark("error", f"{job.name}: no run has a result of {name}")
    if not job.wanted.sequences:
        scored = telling_sequences(job)
        words = "whose success differs most between runs"
        text = f"{job.name}: errors of {', '.join(scored)}, {words}; --sequence names others"
        yield Remark("error", text)
    for name in scored:
        yield from _draw_errors_of(job, name)


def telling_sequences(job: Job, count: int = TELLING) -> list[str]:
    """Sequences whose success differs most with an enhancer, else between any runs.

    Args:
        job: what is drawn.
        count: how many at most.
    """
    from nat2024_reports.figures.curves import ranking_score

    table = job.over().per_sequence()
    score = ranking_score(table, "success")
    names = list(dict.fromkeys(table.sequence))
    if not score:
        return names[:count]
    wide = table.pivot_table(index="sequence", columns="run", values=score, sort=False)
    base = {
        run: row.base for run, row in job.gains().drop_duplicates("run").set_index("run").iterrows()
    }
    pairs = [(run, plain) for run, plain in base.items() if {run, plain} <= set(wide.columns)]
    if pairs:
        gaps = np.stack([(wide[run] - wide[plain]).abs() for run, plain in pairs])
    else:
        gaps = np.stack([wide.max(axis=1) - wide.min(axis=1)])
    worst = np.nan_to_num(gaps).max(axis=0)
    order = np.argsort(-worst, kind="stable")
    return [str(wide.index[place]) for place in order[:count]]


def _runs_with(job: Job, sequence: str) -> list[str]:
    return [r.run for r in job.evaluation.runs if r.run in job.keep and sequence in r.sequences]


def _draw_errors_of(job: Job, sequence: str) -> Iterator[Drawing | Remark]:
    from nat2024_reports.figures.tracking import center_errors_figure

    table = _errors(job, sequence)
    if not np.isfinite(table.error).any():
        yield Remark("error", f"{job.name}, {sequence}: no error is known, nothing is drawn")
        return
    for view in job.views(trackers=False):
        rows = table[table.run.isin(view.looks)].reset_index(drop=True)
        if rows.empty:
            continue
        words = f"Centre location error over the frames of {sequence}{_dashes(view)}"
        yield Drawing(
            name=file_name(job.name, "error", sequence, view.name.lower()),
            kind="error",
            dataset=job.name,
            caption=job.caption(words, 1, after="The grey line is at 20 px"),
            figure=center_errors_figure(rows, view.looks, title=sequence),
            table=job.with_names(rows),
        )


def _dashes(view: "View") -> str:
    if any(look.is_dashed for look in view.looks.values()):
        return ", with an enhancer (solid) and without (dashed)"
    return ""


def _errors(job: Job, sequence: str) -> "pd.DataFrame":
    """`frame, run, error`; frames are counted from 0."""
    import pandas as pd

    parts = []
    for run in job.evaluation.runs:
        if run.run in job.keep and sequence in run.sequences:
            errors = run.sequences[sequence].center_error
            frames = _frames(job, sequence, errors)
            parts.append(pd.DataFrame({"frame": frames, "run": run.run, "error": errors}))
    return pd.concat(parts, ignore_index=True)


def _frames(job: Job, sequence: str, errors: Floats) -> Sequence[int]:
    """Numbers of the scored frames: the keyframes, where only some have a box."""
    dataset = job.dataset()
    if dataset is not None and sequence in dataset:
        keyframes = dataset[sequence].keyframes
        if keyframes is not None and len(keyframes) == len(errors):
            return [int(frame) for frame in keyframes]
    return range(len(errors))


def draw_speed(job: Job) -> Iterator[Drawing | Remark]:
    """Speed against success, of the runs that were timed."""
    from nat2024_reports.figures.curves import ranking_score
    from nat2024_reports.figures.looks import looks_of
    from nat2024_reports.figures.speed import speed_figure

    score = ranking_score(job.summary, "success")
    table = _speeds(job, score) if score else job.summary.iloc[:0]
    untimed = [run for run in job.by_run if run not in set(table.run)]
    if table.empty:
        yield Remark("speed", f"{job.name}: no manifest tells how fast a run was")
        return
    if untimed:
        yield Remark("speed", f"{job.name}: {', '.join(untimed)} not timed, left out")
    if (devices := table[["device", "machine"]].drop_duplicates()).shape[0] > 1:
        names = ", ".join(f"{row.device} on {row.machine}" for row in devices.itertuples())
        yield Remark("speed", f"{job.name}: speeds of different machines ({names})")
    shown = [run for run in job.runs if run.run in set(table.run)]
    looks = looks_of(shown, job.runs, by_tracker=True)
    device = ", ".join(dict.fromkeys(table.device))
    yield Drawing(
        name=file_name(job.name, "speed"),
        kind="speed",
        dataset=job.name,
        caption=job.caption(
            f"{_SCORE_LABELS[score]} against speed ({device})",
            after="Trackers alone are hollow",
        ),
        figure=speed_figure(table, job.by_run, looks, score=_SCORE_LABELS[score]),
        table=job.with_names(table),
    )


def _speeds(job: Job, score: str) -> "pd.DataFrame":
    """`run, frames_per_second, device, machine, value` of the timed runs."""
    import pandas as pd

    values = job.summary.set_index("run")[score]
    rows = []
    for run in job.evaluation.runs:
        manifest = run.manifest
        if run.run not in job.keep or manifest is None or manifest.timing is None:
            continue
        machine = manifest.sessions[-1].machine if manifest.sessions else {}
        name = machine.get("gpu") or machine.get("processor", "an unknown machine")
        speed = manifest.timing.frames_per_second
        if speed > 0 and np.isfinite(values[run.run]):
            rows.append((run.run, speed, manifest.device, name, values[run.run]))
    return pd.DataFrame(rows, columns=["run", "frames_per_second", "device", "machine", "value"])


def draw_light(jobs: Sequence[Job]) -> Iterator[Drawing | Remark]:
    """Success against light level, over datasets that `dataset darken` made of one."""
    families = _families(jobs)
    for day, members in families.items():
        if len(members) < 2:
            level = min(members)
            text = f"{members[level].name}: one light level of {day} only, two make a line"
            yield Remark("light", text)
            continue
        yield from _draw_light_of(day, members)
    if not families:
        text = "no dataset of a light level; `nat-bench dataset darken` makes some, NAME-LEVEL"
        yield Remark("light", text)


def _families(jobs: Sequence[Job]) -> dict[str, dict[float, Job]]:
    """Datasets of light levels by level, under the name of their daytime dataset."""
    from nat2024.synthesis import level_of
    from nat2024_reports.figures.light_levels import DAY

    families: dict[str, dict[float, Job]] = defaultdict(dict)
    for job in jobs:
        if found := level_of(job.name):
            families[found[0]][found[1]] = job
    for job in jobs:
        if job.name in families:
            families[job.name][DAY] = job
    return dict(families)


def _draw_light_of(day: str, members: dict[float, Job]) -> Iterator[Drawing | Remark]:
    from nat2024_reports.figures.curves import ranking_score
    from nat2024_reports.figures.light_levels import light_levels_figure
    from nat2024_reports.figures.looks import views_of

    scores = {ranking_score(job.summary, "success") for job in members.values()}
    if scores not in ({"success_auc"}, {"average_overlap"}):
        yield Remark("light", f"{day}: no success score at every light level")
        return
    score = scores.pop()
    table = _light_table(members, score)
    yield from _gaps(day, table, members)
    every = {run.run: run for job in members.values() for run in job.runs}
    for view in views_of(_without_notes(every), keep=set(table.run)):
        rows = table[table.run.isin(view.looks)].reset_index(drop=True)
        first = next(iter(members.values()))
        protocol = first.evaluation.protocol.title
        words = f"{_SCORE_LABELS[score]} of {day} at light levels{_dashes(view)}"
        named = rows.assign(
            tracker=[every[run].tracker for run in rows.run],
            enhancer=[every[run].enhancer for run in rows.run],
        )
        yield Drawing(
            name=file_name(day, "light", view.name.lower()),
            kind="light",
            dataset=day,
            caption=f"{words} (protocol {protocol}).",
            figure=light_levels_figure(rows, view.looks, score=_SCORE_LABELS[score]),
            table=named,
        )


def _without_notes(runs: "dict[str, NamedRun]") -> "list[NamedRun]":
    import dataclasses

    return [dataclasses.replace(run, note="") for run in runs.values()]


def _light_table(members: dict[float, Job], score: str) -> "pd.DataFrame":
    """`level, dataset, run, sequences, value`."""
    import pandas as pd

    rows = [
        (level, job.name, row["run"], row["sequences"], row[score])
        for level, job in sorted(members.items())
        for row in job.summary.to_dict(orient="records")
    ]
    return pd.DataFrame(rows, columns=["level", "dataset", "run", "sequences", "value"])


def _gaps(day: str, table: "pd.DataFrame", members: dict[float, Job]) -> Iterator[Remark]:
    """Say where a run lacks a level, or sequences differ between levels."""
    for run, rows in table.groupby("run", sort=False):
        if len(rows) < len(members):
            yield Remark("light", f"{day}: {run} has {len(rows)} of {len(members)} light levels")
        if len(set(rows.sequences)) > 1:
            counts = ", ".join(str(count) for count in rows.sequences)
            yield Remark("light", f"{day}: {run} has {counts} sequences at its light levels")
