"""What a reader must know beside the scores."""

from collections.abc import Callable, Collection, Iterable, Mapping
from typing import TYPE_CHECKING, Any

from nat2024.metrics import SequenceScores, summarize

if TYPE_CHECKING:
    from nat2024.evaluation.tables import Evaluation, RunScores

_STRICT_MATTERS = 0.001
"""A difference to the protocol `strict` below this is not worth a line."""

_MOST_LINES = 3
"""Of one kind of remark; more are told in one."""


def notes_of(evaluation: "Evaluation") -> dict[str, Any]:
    """The notes of `Evaluation.notes`, by kind."""
    runs = evaluation.runs
    first = next(iter(runs), None)
    truth = first.sequences if first else {}
    invalid = {n: s.invalid_truth for n, s in truth.items() if s.invalid_truth}
    bad = {
        run.run: {n: s.bad_results for n, s in run.sequences.items() if s.bad_results}
        for run in runs
    }
    unequal = {
        run.run: {n: lengths for n, s in run.sequences.items() if (lengths := _unequal(s))}
        for run in runs
    }
    strict = {
        run.run: round(run.strict_success, 6)
        for run in runs
        if abs(_success(evaluation, run) - run.strict_success) > _STRICT_MATTERS
    }
    found = {
        "invalid_truth_rows": invalid,
        "bad_result_rows": {run: names for run, names in bad.items() if names},
        "unequal_lengths": {run: names for run, names in unequal.items() if names},
        "missing_sequences": {run.run: list(run.missing) for run in runs if run.missing},
        "skipped_frames": {run.run: run.skipped for run in runs if run.skipped},
        "altered_sequences": {run.run: list(run.altered) for run in runs if run.altered},
        "strict_success_auc": strict,
        **_foreign_notes(runs),
    }
    return {key: value for key, value in found.items() if value}


def _foreign_notes(runs: Iterable["RunScores"]) -> dict[str, dict[str, Any]]:
    """What was seen while results without a manifest were read, by kind and run."""
    seen = {run.run: run.foreign for run in runs if run.foreign}
    first = {run: found.first_rows for run, found in seen.items() if found.first_rows}
    return {
        "unreadable_results": {r: dict(f.unreadable) for r, f in seen.items() if f.unreadable},
        "unknown_sequences": {r: dict(f.unknown) for r, f in seen.items() if f.unknown},
        "first_rows": {
            run: {"offset": list(rows.offset), "alike": rows.alike, "words": rows.text}
            for run, rows in first.items()
        },
        "other_first_boxes": {run: list(rows.others) for run, rows in first.items() if rows.others},
        "repeats": {
            run: {"count": found.repeats, "deviation": dict(found.deviation)}
            for run, found in seen.items()
            if found.repeats > 1
        },
    }


def _success(evaluation: "Evaluation", run: "RunScores") -> float:
    return summarize(run.sequences.values(), evaluation.protocol).success_auc


def _unequal(scores: SequenceScores) -> tuple[int, int] | None:
    lengths = scores.length_predicted, scores.length_truth
    return lengths if lengths[0] != lengths[1] else None


_TEXTS: dict[str, tuple[Callable[[Any], str], str]] = {
    "bad_result_rows": (
        lambda rows: f"{sum(rows.values())} bad result rows in {_names(rows)}",
        "bad result rows",
    ),
    "unequal_lengths": (
        lambda names: f"result and ground truth differ in length in {_names(names)}",
        "result and ground truth differ in length",
    ),
    "missing_sequences": (
        lambda names: f"no result of {_count(len(names))}, {_names(names)}",
        "no result of some sequences",
    ),
    "skipped_frames": (
        lambda frames: (
            f"{sum(map(len, frames.values()))} unreadable frames repeat the last box "
            f"in {_names(frames)}"
        ),
        "unreadable frames repeat the last box",
    ),
    "altered_sequences": (
        lambda names: f"made on another length or first box in {_names(names)}",
        "made on another length or first box",
    ),
    "unreadable_results": (
        lambda faults: f"{len(faults)} results left out, such as {next(iter(faults.values()))}",
        "results left out",
    ),
    "unknown_sequences": (
        lambda names: f"no sequence of the dataset is called {_with_closest(names)}",
        "results of sequences that the dataset does not have",
    ),
    "first_rows": (
        lambda rows: rows["words"] if any(rows["offset"]) else "",
        "first rows lie beside the annotation",
    ),
    "other_first_boxes": (
        lambda names: f"started on another box than the annotated one in {_names(names)}",
        "started on another box than the annotated one",
    ),
    "repeats": (
        lambda found: f"mean of {found['count']} repeats{_deviations(found['deviation'])}",
        "mean of several repeats",
    ),
}
"""By kind of note: the words for one run, and in short for many that differ."""


def remarks_of(evaluation: "Evaluation") -> list[str]:
    """The notes as few lines for people."""
    notes = notes_of(evaluation)
    lines = []
    if rows := notes.get("invalid_truth_rows"):
        lines.append(f"{sum(rows.values())} invalid ground-truth rows in {_names(rows)}")
    for kind, (words, short) in _TEXTS.items():
        texts = {run: words(of) for run, of in notes.get(kind, {}).items()}
        lines += _told_once({run: text for run, text in texts.items() if text}, short)
    return lines + _strict_remark(evaluation, notes.get("strict_success_auc", {}))


def _told_once(texts: Mapping[str, str], short: str) -> list[str]:
    """Texts by run as lines: equal ones together, and many different ones in short."""
    by_text: dict[str, list[str]] = {}
    for run, text in texts.items():
        by_text.setdefault(text, []).append(run)
    if len(by_text) > _MOST_LINES:
        text, (run, *_) = next(iter(by_text.items()))
        return [f"{len(texts)} runs: {short}, not alike; in {run}: {text}"]
    return [f"{_names(runs)}: {text}" for text, runs in by_text.items()]


def _strict_remark(evaluation: "Evaluation", strict: Mapping[str, float]) -> list[str]:
    ours = {run.run: _success(evaluation, run) for run in evaluation.runs if run.run in strict}
    if not strict:
        return []
    most = max(strict, key=lambda run: round(abs(strict[run] - ours[run]), 3))
    success = f"success is {ours[most]:.3f} here and {strict[most]:.3f} under strict"
    if len(strict) == 1:
        return [f"{most}: {success}"]
    return [f"{len(strict)} runs differ from protocol strict, most {most}: {success}"]


def _with_closest(names: Mapping[str, str]) -> str:
    texts = [f"{name} ({near})" if near else name for name, near in names.items()]
    return _names(texts, 3)


def _deviations(deviation: Mapping[str, float]) -> str:
    shown = {"success_auc": "success", "precision_20": "precision"}
    texts = [f"{word} {deviation[name]:.4f}" for name, word in shown.items() if name in deviation]
    return f", standard deviation {', '.join(texts)}" if texts else ""


def _count(sequences: int) -> str:
    return "1 sequence" if sequences == 1 else f"{sequences} sequences"


def _names(names: Collection[str], count: int = 5) -> str:
    return ", ".join(list(names)[:count]) + (", ..." if len(names) > count else "")
