"""Figures of scores: curves, bars, attributes, radar, gains."""

from collections.abc import Iterator
from typing import TYPE_CHECKING

from nat2024.cli.display_names import attribute_name, category_name
from nat2024.cli.plotting.jobs import Drawing, Group, Job, Remark, file_name

if TYPE_CHECKING:
    import pandas as pd

    from nat2024_reports.figures.looks import View

_METRIC_NAMES = {
    "precision": "precision",
    "normalized_precision": "normalized precision",
    "success": "success",
}
_SCORE_NAMES = {
    "precision_20": "precision at 20 px",
    "normalized_precision_20": "normalized precision at 0.20",
    "normalized_precision_auc": "the area under normalized precision",
    "success_auc": "the area under success",
    "average_overlap": "average overlap",
}


def draw_curves(job: Job) -> Iterator[Drawing | Remark]:
    """Curves and bars of all sequences."""
    yield from _draw_curves_of(job, None)
    yield from _draw_bars(job)


def draw_attributes(job: Job) -> Iterator[Drawing | Remark]:
    """Curves of each attribute and category."""
    if not job.groups:
        yield Remark("attributes", f"{job.name}: its sequences carry no attribute and no category")
    for group in job.groups.values():
        yield from _draw_curves_of(job, group)


def _draw_curves_of(job: Job, group: Group | None) -> Iterator[Drawing | Remark]:
    from nat2024_reports.figures.curves import curve_table, curves_figure

    kind = "attributes" if group else "curves"
    names = group.sequences if group else None
    evaluation = job.over(names)
    summary, curves = evaluation.summary(), evaluation.curves()
    count = int(summary.sequences.max()) if len(summary) else 0
    table = curve_table(curves, summary)
    where = f"{job.name}, {group.name}" if group else job.name
    if table.empty:
        yield Remark(kind, f"{where}: no curve holds a number, nothing is drawn")
        return
    if group is None:
        yield from _undefined(job, table)
    if count == 1:
        yield Remark(kind, f"{where}: one sequence only, its curves are no mean of several")
    title = _group_title(group, count) if group else ""
    for view in job.views(trackers=group is None):
        rows = table[table.run.isin(view.looks)].reset_index(drop=True)
        if rows.empty:
            continue
        yield Drawing(
            name=file_name(job.name, "curves", *_group_parts(group), view.name.lower()),
            kind=kind,
            dataset=job.name,
            caption=_curves_caption(job, rows, view, group, count),
            figure=curves_figure(rows, view.looks, title=title),
            table=job.with_names(rows),
        )


def _undefined(job: Job, table: "pd.DataFrame") -> Iterator[Remark]:
    """Say which curves the protocol or a run does not have."""
    there = table.groupby("metric").run.agg(set).to_dict()
    for metric, name in _METRIC_NAMES.items():
        drawn = there.get(metric, set())
        missing = [run for run in job.by_run if run not in drawn]
        if not drawn:
            protocol = job.evaluation.protocol.title
            yield Remark("curves", f"{job.name}: protocol {protocol} defines no {name} to rank by")
        elif missing:
            text = f"{job.name}: {', '.join(missing)} without a number in {name}, left out"
            yield Remark("curves", text)


def _curves_caption(
    job: Job, rows: "pd.DataFrame", view: "View", group: Group | None, count: int
) -> str:
    metrics = [_METRIC_NAMES[metric] for metric in dict.fromkeys(rows.metric)]
    ranks = [_SCORE_NAMES[score] for score in dict.fromkeys(rows.score_name)]
    words = f"{_listed(metrics).capitalize()} plots{_view_words(view)}"
    if group and group.is_category:
        words += f" for the category {category_name(group.name)}"
    elif group:
        mark = "" if group.provenance == "published" else f" ({group.provenance})"
        words += f" for the attribute {attribute_name(group.name)}{mark}"
    return job.caption(words, count, after=f"Legends rank by {_listed(ranks)}")


def _view_words(view: "View") -> str:
    compared = any(look.is_dashed for look in view.looks.values())
    enhancers = list(dict.fromkeys(run.enhancer for run in view.runs if not run.is_plain))
    if not enhancers:
        return " of trackers without an enhancer"
    if not compared:
        return f" with {_listed(enhancers)}"
    if view.is_by_tracker:
        return f" of trackers with {enhancers[0]} (solid) and without (dashed)"
    return f" of {view.runs[0].tracker} with enhancers (solid) and without (dashed)"


def _listed(words: list[str]) -> str:
    return " and ".join(filter(None, [", ".join(words[:-1]), *words[-1:]]))


def _group_parts(group: Group | None) -> tuple[str, ...]:
    if group is None:
        return ()
    return ("category", group.name) if group.is_category else (group.name,)


def _group_title(group: Group, count: int) -> str:
    unit = "sequence" if count == 1 else "sequences"
    if group.is_category:
        return f"Category {category_name(group.name)}: {count} {unit}"
    marks = {"published": "", "mixed": ", partly computed"}
    mark = marks.get(group.provenance, f", {group.provenance} attribute")
    name = attribute_name(group.name)
    title = name if name == group.name else f"{name[0].upper()}{name[1:]}"
    return f"{title}: {count} {unit}{mark}"


def _draw_bars(job: Job) -> Iterator[Drawing | Remark]:
    from nat2024_reports.figures.bars import overall_figure, overall_table

    table = overall_table(job.summary, job.gains())
    if table.empty:
        yield Remark("curves", f"{job.name}: no score holds a number, no bars are drawn")
        return
    for view in job.views():
        rows = table[table.run.isin(view.looks)].reset_index(drop=True)
        words = f"Overall performance{_view_words(view)}".replace("dashed", "hollow")
        words = words.replace("solid", "filled")
        is_grey = (
            "Numbers are grey where the 95 % interval of the gain includes 0, or over fewer than "
            "6 sequences"
        )
        yield Drawing(
            name=file_name(job.name, "bars", view.name.lower()),
            kind="curves",
            dataset=job.name,
            caption=job.caption(words, after=is_grey if rows.gain.notna().any() else ""),
            figure=overall_figure(rows, view.looks),
            table=job.with_names(rows),
        )


def draw_radar(job: Job) -> Iterator[Drawing | Remark]:
    """A radar of attributes, and one of categories."""
    for is_category in (False, True):
        groups = [g for g in job.groups.values() if g.is_category == is_category]
        yield from _draw_radar_of(job, groups, "categories" if is_category else "attributes")


def _draw_radar_of(job: Job, groups: list[Group], words: str) -> Iterator[Drawing | Remark]:
    from nat2024_reports.figures.curves import ranking_score
    from nat2024_reports.figures.radar import LEAST, MOST, radar_figure

    groups = [group for group in groups if job.over(group.sequences).runs]
    score = ranking_score(job.summary, "success")
    if len(groups) < LEAST or not score:
        if groups or words == "attributes":
            why = f"{len(groups)} {words}, a radar needs {LEAST}" if score else "no success score"
            yield Remark("radar", f"{job.name}: {why}")
        return
    if len(groups) > MOST:
        yield Remark("radar", f"{job.name}: {len(groups)} {words}, the {MOST} largest are drawn")
        largest = sorted(groups, key=lambda group: -len(group.sequences))[:MOST]
        groups = [group for group in groups if group in largest]
    table = _scores_by_group(job, groups, score)
    is_computed = any(group.is_computed for group in groups)
    by = "category" if words == "categories" else "attribute"
    for view in job.views():
        rows = table[table.run.isin(view.looks)].reset_index(drop=True)
        caption = f"{_SCORE_NAMES[score].capitalize()} by {by}{_view_words(view)}"
        title = "* computed attribute" if is_computed else ""
        yield Drawing(
            name=file_name(job.name, "radar", words, view.name.lower()),
            kind="radar",
            dataset=job.name,
            caption=job.caption(caption, after="A star: computed" if is_computed else ""),
            figure=radar_figure(rows, view.looks, title=title),
            table=job.with_names(rows),
        )


def _scores_by_group(job: Job, groups: list[Group], score: str) -> "pd.DataFrame":
    """One row a group and run: `label, run, sequences, provenance, value`."""
    import pandas as pd

    rows = []
    for group in groups:
        summary = job.over(group.sequences).summary()
        count = int(summary.sequences.max()) if len(summary) else 0
        name = category_name(group.name) if group.is_category else group.name
        label = f"{name}{'*' if group.is_computed else ''} ({count})"
        for row in summary.to_dict(orient="records"):
            provenance = group.provenance
            numbers = (row["sequences"], provenance, row[score])
            rows.append((label, row["run"], *numbers))
    return pd.DataFrame(rows, columns=["label", "run", "sequences", "provenance", "value"])


def draw_gains(job: Job) -> Iterator[Drawing | Remark]:
    """Gains over the tracker alone: of all sequences, by attribute, by category."""
    gains = job.gains()
    if gains.empty:
        text = f"{job.name}: no run with an enhancer beside its tracker alone, so no gain"
        yield Remark("gains", text)
        return
    yield from _draw_overall_gains(job, gains)
    for by in ("attribute", "category"):
        groups = {name: g for name, g in job.groups.items() if g.is_category == (by == "category")}
        if groups:
            yield from _draw_gains_by(job, by, groups)


_GAIN_COLUMNS = ("difference", "difference_low", "difference_high", "gain", "certain")


def _draw_overall_gains(job: Job, gains: "pd.DataFrame") -> Iterator[Drawing | Remark]:
    from nat2024_reports.figures.bars import METRICS, gains_figure
    from nat2024_reports.figures.looks import looks_of

    shown = [run for run in job.runs if run.run in set(gains.run)]
    by_tracker = len({run.tracker for run in job.runs if run.run in job.keep}) > 1
    looks = looks_of(shown, job.runs, by_tracker=by_tracker)
    order = {run.run: number for number, run in enumerate(shown)}
    rows = gains[gains.metric.isin(METRICS)].sort_values(
        "run", key=lambda names: names.map(order), kind="stable"
    )
    rows = rows.assign(label=[job.by_run[run].label for run in rows.run])
    few = int(rows.sequences.max())
    yield from _few_sequences(job, few)
    yield Drawing(
        name=file_name(job.name, "gains"),
        kind="gains",
        dataset=job.name,
        caption=job.caption(
            "Gains over the tracker alone with 95 % intervals (paired bootstrap)", few
        ),
        figure=gains_figure(
            rows, colors={job.by_run[run].label: look.color for run, look in looks.items()}
        ),
        table=job.with_names(rows),
    )


def _few_sequences(job: Job, count: int) -> Iterator[Remark]:
    if count < 6:
        unit = "sequence" if count == 1 else "sequences"
        text = f"{job.name}: gains over {count} {unit} are never certain; at least 6 are needed"
        yield Remark("gains", text)


def _draw_gains_by(job: Job, by: str, groups: dict[str, Group]) -> Iterator[Drawing]:
    from nat2024_reports.figures.bars import METRICS, gains_figure

    gains = job.gains(by=by)
    gains = gains[gains.metric.isin(METRICS) & gains[by].isin(groups)]
    plural = "attributes" if by == "attribute" else "categories"
    for run, rows in gains.groupby("run", sort=False):
        named = job.by_run[str(run)]
        stars = ["*" if groups[name].is_computed else "" for name in rows[by]]
        labels = [
            f"{category_name(name) if by == 'category' else name}{star} ({count})"
            for name, star, count in zip(rows[by], stars, rows.sequences, strict=True)
        ]
        drawn = rows.assign(label=labels)
        if by == "attribute":
            drawn["provenance"] = [groups[name].provenance for name in rows[by]]
        words = f"Gains of {named.enhancer} over {named.tracker} alone by {by}, with 95 % intervals"
        yield Drawing(
            name=file_name(job.name, "gains", plural, str(run).replace("+", "_")),
            kind="gains",
            dataset=job.name,
            caption=job.caption(words, after="A star: computed" if any(stars) else ""),
            figure=gains_figure(
                drawn, title=named.label + (" (* computed attribute)" if any(stars) else "")
            ),
            table=job.with_names(drawn),
        )
