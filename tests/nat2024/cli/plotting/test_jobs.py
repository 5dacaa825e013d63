"""Which figures come of which scores; evaluations are made in code."""

import dataclasses
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from nat2024.cli.display_names import attribute_name, display_name, display_names
from nat2024.cli.plotting import details, scores
from nat2024.cli.plotting.jobs import Drawing, Job, Remark, Wanted, file_name
from nat2024.evaluation import Evaluation, RunScores
from nat2024.metrics import evaluate_boxes, get_protocol
from nat2024.store import DatasetRecord, Manifest, PluginRecord, StageTimes
from nat2024.synthesis import level_folder, level_of

NAMES = [f"s{number}" for number in range(8)]


def run_scores(run: str, shift: float, *, speed: float = 0.0, names: Iterable[str] = NAMES) -> Any:
    tracker, _, enhancer = run.partition("+")
    truth = np.tile([50.0, 50, 20, 20], (12, 1))
    found = {}
    for number, name in enumerate(names):
        boxes = truth.copy()
        boxes[6:, 0] += shift + number
        found[name] = evaluate_boxes(boxes, truth)
    manifest = None
    if speed:
        times = StageTimes(12, 0, 0, 0, 0, speed, speed)
        manifest = Manifest(
            dataset=DatasetRecord("d"), tracker=PluginRecord(tracker), timing=times, device="cpu"
        )
    return RunScores(run, tracker, enhancer or "none", "patch", found, (), (), {}, 0.5, manifest)


def evaluation(*runs: Any, name: str = "d", **about: Any) -> Evaluation:
    return Evaluation(name, get_protocol("pysot"), runs, **about)


PAIR = (run_scores("kcf", 4, speed=90), run_scores("kcf+gamma", 1, speed=60))
ATTRIBUTES: dict[str, tuple[str, ...]] = {
    "IV": ("s0", "s1", "s2"),
    "UL": ("s3", "s4"),
    "FM": ("s5",),
}
COMPUTED = {"s3": {"UL": "computed"}, "s4": {"UL": "computed"}, "s0": {"IV": "computed"}}
CATEGORIES = {"car": ("s0", "s1"), "person": ("s2",), "bus": ("s3", "s4", "s5", "s6", "s7")}


@pytest.fixture(scope="module")
def job() -> Job:
    about = {"attributes": ATTRIBUTES, "provenance": COMPUTED, "categories": CATEGORIES}
    return Job(evaluation(*PAIR, **about))


def split(made: Iterable[Drawing | Remark]) -> tuple[dict[str, Drawing], list[str]]:
    items = list(made)
    drawings = {one.name: one for one in items if isinstance(one, Drawing)}
    return drawings, [one.text for one in items if isinstance(one, Remark)]


def test_each_attribute_and_category_has_its_curves(job: Job) -> None:
    drawings, remarks = split(scores.draw_attributes(job))
    assert {name: one.figure.get_suptitle() for name, one in drawings.items()} == {
        "d_curves_IV": "Illumination variation (IV): 3 sequences, partly computed",
        "d_curves_UL": "Uneven light (UL): 2 sequences, computed attribute",
        "d_curves_FM": "Fast motion (FM): 1 sequence",
        "d_curves_category_car": "Category car: 2 sequences",
        "d_curves_category_person": "Category person: 1 sequence",
        "d_curves_category_bus": "Category bus: 5 sequences",
    }
    assert (
        "attribute uneven light (UL) (computed) on d (2 sequences"
        in drawings["d_curves_UL"].caption
    )
    assert [text.split(":")[0] for text in remarks] == ["d, FM", "d, person"]
    assert "one sequence only" in remarks[0]


def test_curves_of_an_attribute_are_means_over_its_sequences(job: Job) -> None:
    drawings, _ = split(scores.draw_attributes(job))
    table = drawings["d_curves_UL"].table
    curve = table[(table.run == "kcf") & (table.metric == "success")].value.to_numpy()
    both = [PAIR[0].sequences[name].success_curve for name in ("s3", "s4")]
    np.testing.assert_allclose(curve, np.mean(both, axis=0))


def test_wanted_attributes_only() -> None:
    chosen = Wanted(attributes=("UL", "bus"))
    job = Job(evaluation(*PAIR, attributes=ATTRIBUTES, categories=CATEGORIES), chosen)
    assert list(split(scores.draw_attributes(job))[0]) == ["d_curves_UL", "d_curves_category_bus"]
    drawings, remarks = split(scores.draw_radar(job))
    assert not drawings
    assert remarks == ["d: 1 attributes, a radar needs 3", "d: 1 categories, a radar needs 3"]


def test_radars_mark_computed_attributes(job: Job) -> None:
    drawings, _ = split(scores.draw_radar(job))
    assert list(drawings) == ["d_radar_attributes", "d_radar_categories"]
    table = drawings["d_radar_attributes"].table
    assert list(dict.fromkeys(table.label)) == ["IV* (3)", "UL* (2)", "FM (1)"]
    assert list(dict.fromkeys(table.provenance)) == ["mixed", "computed", "published"]
    assert drawings["d_radar_attributes"].figure.get_suptitle() == "* computed attribute"
    assert drawings["d_radar_categories"].figure.get_suptitle() == ""


def test_gains_of_all_by_attribute_and_by_category(job: Job) -> None:
    drawings, remarks = split(scores.draw_gains(job))
    assert list(drawings) == [
        "d_gains",
        "d_gains_attributes_kcf_gamma",
        "d_gains_categories_kcf_gamma",
    ]
    assert remarks == []
    overall = drawings["d_gains"].table
    expected = job.evaluation.gains()
    row = overall[overall.metric == "success_auc"].iloc[0]
    wanted = expected[expected.metric == "success_auc"].iloc[0]
    for column in ("difference", "difference_low", "difference_high", "gain"):
        assert row[column] == wanted[column]
    by_attribute = drawings["d_gains_attributes_kcf_gamma"]
    assert "(* computed attribute)" in by_attribute.figure.get_suptitle()
    assert list(dict.fromkeys(by_attribute.table.label)) == ["IV* (3)", "UL* (2)", "FM (1)"]


def test_gains_over_few_sequences_are_said_to_be_uncertain() -> None:
    few = [run_scores(name, 1, names=["s0", "s1"]) for name in ("kcf", "kcf+gamma")]
    drawings, remarks = split(scores.draw_gains(Job(evaluation(*few))))
    assert len(drawings) == 1
    assert "at least 6 are needed" in remarks[0]


def test_runs_that_lack_sequences_say_so_in_the_legend() -> None:
    part = run_scores("mosse", 2, names=NAMES[:6])
    job = Job(evaluation(*PAIR, part))
    (drawing, *_) = split(scores.draw_curves(job))[0].values()
    legend = [text.get_text() for text in drawing.figure.axes[0].get_legend().get_texts()]
    assert any(text.endswith("MOSSE (6/8 seq.)") for text in legend)


def test_many_trackers_and_enhancers_make_views() -> None:
    runs = [run_scores(f"{t}{e}", 1) for t in ("kcf", "mosse") for e in ("", "+gamma", "+clahe")]
    drawings, _ = split(scores.draw_curves(Job(evaluation(*runs))))
    names = ["with_gamma_correction", "with_clahe", "kcf", "mosse"]
    assert list(drawings) == [f"d_{kind}_{name}" for kind in ("curves", "bars") for name in names]


def test_speed_is_drawn_of_timed_runs_only() -> None:
    drawings, remarks = split(details.draw_speed(Job(evaluation(*PAIR, run_scores("mosse", 2)))))
    assert remarks == ["d: mosse not timed, left out"]
    assert drawings["d_speed"].table.frames_per_second.tolist() == [90, 60]
    drawings, remarks = split(details.draw_speed(Job(evaluation(run_scores("mosse", 2)))))
    assert not drawings
    assert remarks == ["d: no manifest tells how fast a run was"]


def test_the_most_telling_sequences_differ_most() -> None:
    other = dataclasses.replace(
        PAIR[1], sequences={**PAIR[1].sequences, "s5": run_scores("a", 90).sequences["s5"]}
    )
    job = Job(evaluation(PAIR[0], other))
    assert details.telling_sequences(job)[0] == "s5"
    assert len(details.telling_sequences(job)) == 4
    assert len(details.telling_sequences(Job(evaluation(PAIR[0])), 2)) == 2


def test_errors_lie_at_the_keyframes() -> None:
    class Known:
        keyframes = np.arange(0, 120, 10)

    job = Job(evaluation(*PAIR), Wanted(sequences=("s1", "s9")), lambda: {"s1": Known})  # type: ignore[arg-type,return-value]
    drawings, remarks = split(details.draw_errors(job))
    table = drawings["d_error_s1"].table
    assert table[table.run == "kcf"].frame.tolist() == list(range(0, 120, 10))
    assert remarks == ["d: no run has a result of s9"]


def test_light_levels_are_read_from_the_names_of_datasets() -> None:
    jobs = [
        Job(evaluation(run_scores("kcf", shift), run_scores("kcf+gamma", shift / 2), name=name))
        for name, shift in (("day", 1), ("day-0.12", 3), ("day-0.06", 6), ("else-0.1", 2))
    ]
    drawings, remarks = split(details.draw_light(jobs))
    assert remarks == ["else-0.1: one light level of else only, two make a line"]
    table = drawings["day_light"].table
    plain = table[table.run == "kcf"]
    assert plain.level.tolist() == [0.06, 0.12, 1.0]
    expected = [jobs[place].summary.success_auc[0] for place in (2, 1, 0)]
    assert plain.value.tolist() == expected
    assert split(details.draw_light(jobs[:1]))[1][0].startswith("no dataset of a light level")


@pytest.mark.parametrize(("name", "level"), [("day", 0.06), ("a-0.5", 0.125), ("b-2", 0.5)])
def test_names_of_levels_are_read_as_they_are_written(name: str, level: float) -> None:
    assert level_of(level_folder(Path("out"), name, level).name) == (name, level)
    assert level_of(name if name == "day" else f"{name}x") is None


def test_a_run_that_lacks_a_light_level_is_named() -> None:
    jobs = [
        Job(evaluation(run_scores("kcf", 1), name="day-0.12")),
        Job(evaluation(run_scores("kcf", 2), run_scores("mosse", 2), name="day-0.06")),
    ]
    assert split(details.draw_light(jobs))[1] == ["day: mosse has 1 of 2 light levels"]


@pytest.mark.parametrize(
    ("title", "kind", "shown"),
    [
        ("siamrpnpp (compact)", "tracker", "SiamRPN++ (compact)"),
        ("siamrpnpp@mine", "tracker", "SiamRPN++@mine"),
        ("gamma", "enhancer", "Gamma correction"),
        ("none", "enhancer", "none"),
        ("gamma", "tracker", "gamma"),
        ("<b>$x$", "tracker", "<b>$x$"),
    ],
)
def test_display_names(title: str, kind: Any, shown: str) -> None:
    assert display_name(title, kind) == shown


def test_names_that_would_coincide_stay_apart() -> None:
    assert display_names(["kcf", "KCF"], "tracker") == {"kcf": "kcf", "KCF": "KCF"}


def test_attribute_names() -> None:
    assert attribute_name("IV") == "illumination variation (IV)"
    assert attribute_name("uav") == "uav"


def test_names_of_files() -> None:
    assert file_name("day-0.1", "curves", "", "with_SiamAPN++") == "day-0.1_curves_with_SiamAPNpp"
    assert file_name("../x", "<b>") == "x_b"
    assert file_name("夜") == "figure"
