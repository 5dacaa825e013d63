"""The main job: all combinations, resuming, failures that cost nothing else, the same bytes."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import nat2024
from nat2024.engine import benchmark, combine, planning, run_benchmark
from nat2024.engine.units import Trackers
from nat2024.engine.workers import run_in_process
from nat2024.errors import DatasetIncomplete, ResultConflict, UsageError
from nat2024.store import RunFolder

pytestmark = pytest.mark.usefixtures("small_plugins")


def run(
    folder: Path, results: Path, trackers: str = "still", enhancers: str = "none", **settings: Any
) -> Any:
    chosen = {key: settings.pop(key) for key in ("options", "weights", "scope") if key in settings}
    combinations = combine(trackers.split(), enhancers.split(), **chosen)
    return run_benchmark(combinations, nat2024.load_dataset(folder), results, **settings)


def box_files(results: Path) -> dict[str, bytes]:
    return {str(p.relative_to(results)): p.read_bytes() for p in sorted(results.rglob("*.txt"))}


def test_every_combination_runs_over_every_sequence(night_clip: Path, tmp_path: Path) -> None:
    report = run(night_clip, tmp_path, "still still@b", "none invert gamma@soft")
    assert report.tracked == 2 * 3 * 3
    assert report.failures == ()
    assert set(report.runs) == {
        "still",
        "still+invert",
        "still+gamma@soft",
        "still@b",
        "still@b+invert",
        "still@b+gamma@soft",
    }
    for name in report.runs:
        folder = RunFolder(tmp_path / "night_clip" / name)
        assert folder.finished() == ["narrow", "tall", "wide"]
        assert folder.boxes("wide").shape == (8, 4)
        assert folder.seconds("wide").shape == (8, 3)


def test_row_0_is_what_init_gives_and_the_enhancer_reaches_the_tracker(
    night_clip: Path, tmp_path: Path
) -> None:
    run(night_clip, tmp_path, "still", "none invert")
    sequence = nat2024.load_dataset(night_clip)["wide"]
    means = np.array([sequence.image(i).mean() for i in range(8)])
    plain = RunFolder(tmp_path / "night_clip" / "still").boxes("wide")
    np.testing.assert_allclose(plain[:, 0], sequence.boxes[0, 0] + means / 100, atol=1e-12)
    inverted = RunFolder(tmp_path / "night_clip" / "still+invert").boxes("wide")
    shift = (255 - means) / 100
    np.testing.assert_allclose(inverted[:, 0], sequence.boxes[0, 0] + shift, atol=1e-12)


def test_scope_patch_leaves_the_frame_to_the_tracker(night_clip: Path, tmp_path: Path) -> None:
    run(night_clip, tmp_path / "frame", "still", "invert", scope="frame")
    run(night_clip, tmp_path / "patch", "still", "invert", scope="patch")
    run(night_clip, tmp_path / "plain", "still", "none")
    files = [next(iter(box_files(tmp_path / k).values())) for k in ("frame", "patch", "plain")]
    assert files[1] == files[2] != files[0]  # `still` never enhances a patch


def test_the_manifest_tells_what_ran(night_clip: Path, tmp_path: Path) -> None:
    options = {"still@b": {"step": "0.5"}}
    run(night_clip, tmp_path, "still@b", "gamma", options=options, threads=2)
    stored = json.loads((tmp_path / "night_clip" / "still@b+gamma" / "run.json").read_text())
    assert stored["tracker"]["name"] == "still"
    assert stored["tracker"]["label"] == "b"
    assert stored["tracker"]["options"] == {"step": 0.5, "scope": "frame"}
    assert stored["enhancer"]["options"]["gamma"] == 0.5
    assert stored["scope"] == "frame"
    assert stored["device"] == "cpu"
    assert stored["threads"] == 2
    assert stored["repeatable"] is True
    assert stored["dataset"]["source"] == str(night_clip)
    assert set(stored["starts"]) == {"narrow", "tall", "wide"}
    (session,) = stored["sessions"]
    assert session["finished"] >= session["started"]
    assert {"nat-bench", "numpy", "torch", "python"} <= set(session["versions"])
    assert stored["timing"]["frames"] == 24
    assert stored["timing"]["enhance"] > 0


def test_finished_sequences_are_never_tracked_again(night_clip: Path, tmp_path: Path) -> None:
    run(night_clip, tmp_path)
    folder = RunFolder(tmp_path / "night_clip" / "still")
    folder.box_file("wide").write_text("7,7,7,7\n" * 8)
    folder.box_file("tall").unlink()
    report = run(night_clip, tmp_path)
    assert (report.tracked, report.skipped) == (1, 2)
    assert folder.box_file("wide").read_text() == "7,7,7,7\n" * 8
    manifest = folder.manifest()
    assert manifest is not None
    assert len(manifest.sessions) == 2
    assert run(night_clip, tmp_path).tracked == 0
    assert folder.manifest() == manifest


def test_a_result_of_the_wrong_length_is_told(night_clip: Path, tmp_path: Path) -> None:
    run(night_clip, tmp_path)
    (tmp_path / "night_clip" / "still" / "wide.txt").write_text("7,7,7,7\n")
    with pytest.raises(ResultConflict, match=r"wide\.txt: 1 rows, but the sequence has 8 frames"):
        run(night_clip, tmp_path)


def test_other_options_are_refused_and_lose_nothing(night_clip: Path, tmp_path: Path) -> None:
    run(night_clip, tmp_path)
    before = box_files(tmp_path)
    with pytest.raises(ResultConflict, match=r"still.step 0.0 \(now 3.0\)"):
        run(night_clip, tmp_path, options={"still": {"step": 3}})
    assert box_files(tmp_path) == before
    run(night_clip, tmp_path, "still@three", options={"still@three": {"step": 3}})


def test_a_failing_sequence_is_told_and_the_others_go_on(night_clip: Path, tmp_path: Path) -> None:
    report = run(night_clip, tmp_path, "fails still")
    (failure,) = report.failures
    assert (failure.run, failure.sequence) == ("fails", "wide")
    assert failure.reason == "frame 5 of 8: ValueError: lost its mind"
    folder = RunFolder(tmp_path / "night_clip" / "fails")
    assert folder.finished() == ["narrow", "tall"]
    manifest = folder.manifest()
    assert manifest is not None
    assert manifest.failures == {"wide": failure.reason}
    assert len(RunFolder(tmp_path / "night_clip" / "still").finished()) == 3


def test_a_failure_that_is_mended_leaves_the_manifest(night_clip: Path, tmp_path: Path) -> None:
    run(night_clip, tmp_path, "fails")
    folder = RunFolder(tmp_path / "night_clip" / "fails")
    folder.write("wide", _track(8))
    folder.box_file("tall").unlink()
    run(night_clip, tmp_path, "fails")
    manifest = folder.manifest()
    assert manifest is not None
    assert manifest.failures == {}


def _track(frames: int) -> Any:
    from nat2024.store import Track

    return Track(np.ones((frames, 4)), np.ones((frames, 3)))


def test_a_worker_that_dies_costs_only_its_own_sequence(
    night_clip: Path, tmp_path: Path, small_plugins: str
) -> None:
    how = {"timeout": 60, "retries": 1, "plugins": (small_plugins,)}
    report = run(night_clip, tmp_path, "dies still", **how)
    (failure,) = report.failures
    assert (failure.run, failure.sequence) == ("dies", "wide")
    assert "worker process died" in failure.reason
    assert RunFolder(tmp_path / "night_clip" / "dies").finished() == ["narrow", "tall"]
    assert len(RunFolder(tmp_path / "night_clip" / "still").finished()) == 3
    assert not list(tmp_path.rglob("*.tmp"))


def test_results_do_not_depend_on_the_number_of_workers(
    night_clip: Path, tmp_path: Path, small_plugins: str
) -> None:
    failures = []
    for workers in (1, 2):
        how = {"workers": workers, "plugins": (small_plugins,)}
        report = run(night_clip, tmp_path / str(workers), "still fails", "none clahe", **how)
        failures.append(sorted((f.run, f.sequence, f.reason) for f in report.failures))
    assert box_files(tmp_path / "1") == box_files(tmp_path / "2")
    assert len(box_files(tmp_path / "1")) == 10
    assert failures[0] == failures[1]
    assert [run for run, _, _ in failures[0]] == ["fails", "fails+clahe"]


def test_a_truncated_frame_fails_its_sequence_only(night_clip: Path, tmp_path: Path) -> None:
    import shutil

    copy = tmp_path / "copy"
    shutil.copytree(night_clip, copy)
    frame = copy / "data_seq" / "tall" / "00003.png"
    frame.write_bytes(frame.read_bytes()[:200])
    report = run(copy, tmp_path / "results")
    (failure,) = report.failures
    assert failure.sequence == "tall"
    assert "truncated" in failure.reason
    assert "00003.png" in failure.reason


def test_what_is_not_run_cannot_have_options_or_weights() -> None:
    with pytest.raises(UsageError, match=r"options for stil, which is not run; closest: still"):
        combine(["still"], ["none"], options={"stil": {"step": 1}})
    with pytest.raises(UsageError, match="weights for gamma, which is not run"):
        combine(["still"], ["none"], weights={"gamma": "a.pth"})


@pytest.mark.parametrize("text", ["Still", "still@", "still@a/b", "still@..@", ""])
def test_names_that_are_no_names(text: str) -> None:
    with pytest.raises(UsageError, match="neither NAME nor NAME@LABEL"):
        combine([text], ["none"])


def test_display_names_lead_to_names() -> None:
    with pytest.raises(UsageError, match="closest: siamrpnpp"):
        combine(["SiamRPN++"], ["none"])


def test_one_scope_at_a_time() -> None:
    with pytest.raises(UsageError, match=r"scope frame for all, but still\.scope=patch"):
        combine(["still"], ["none"], options={"still": {"scope": "patch"}}, scope="frame")


def test_a_combination_named_twice_is_refused() -> None:
    with pytest.raises(UsageError, match="still is named twice; give one of them a label"):
        combine(["still", "still"], ["none"])


def test_impossible_devices_and_counts(night_clip: Path, tmp_path: Path) -> None:
    dataset = nat2024.load_dataset(night_clip)
    with pytest.raises(UsageError, match="'tpu' is none of cpu, cuda, cuda:N"):
        run_benchmark(combine(["still"], ["none"], device="tpu"), dataset, tmp_path)
    with pytest.raises(UsageError, match="torch sees"):
        run_benchmark(combine(["still"], ["none"], device="cuda:99"), dataset, tmp_path)
    with pytest.raises(UsageError, match="at least 1"):
        run_benchmark(combine(["still"], ["none"]), dataset, tmp_path, workers=0)
    with pytest.raises(DatasetIncomplete, match="no annotated sequence"):
        run_benchmark(combine(["still"], ["none"]), dataset.select([]), tmp_path)
    assert not list(tmp_path.iterdir())


def test_results_of_another_dataset_are_not_taken_for_these(
    night_clip: Path, tmp_path: Path
) -> None:
    import shutil

    run(night_clip, tmp_path / "results")
    other = tmp_path / "night_clip"
    shutil.copytree(night_clip, other)
    path = other / "anno" / "tall.txt"
    rows = path.read_text().splitlines()
    path.write_text("\n".join(["1,2,14,20", *rows[1:]]))
    with pytest.raises(ResultConflict, match=r"tall\.txt: made on another dataset"):
        run(other, tmp_path / "results")
    evaluation = nat2024.evaluate(tmp_path / "results", nat2024.load_dataset(other))
    assert evaluation.notes()["altered_sequences"] == {"still": ["tall"]}
    assert "still: made on another length or first box in tall" in evaluation.remarks()


def test_the_dataset_is_found_again_from_the_manifest(night_clip: Path, tmp_path: Path) -> None:
    from nat2024.evaluation import dataset_of_runs

    run(night_clip, tmp_path)
    assert [s.name for s in dataset_of_runs(tmp_path / "night_clip")] == ["narrow", "tall", "wide"]


def test_a_tracker_whose_box_has_another_shape_fails(night_clip: Path, tmp_path: Path) -> None:
    from nat2024 import register_tracker
    from nat2024.cards import Card
    from nat2024.interfaces import Tracker

    @register_tracker("shapeless")
    class Shapeless(Tracker):
        card = Card(title="Shapeless", summary="")

        def start(self, image: Any, box: Any) -> Any:
            return box

        def advance(self, image: Any) -> Any:
            return 5.0, 1.0

    failures = run(night_clip, tmp_path, "shapeless").failures
    assert len(failures) == 3
    assert failures[0].reason == "frame 2 of 8: shapeless gave a box of shape (), expected (4,)"


def test_damaged_times_lose_nothing(night_clip: Path, tmp_path: Path) -> None:
    run(night_clip, tmp_path)
    folder = RunFolder(tmp_path / "night_clip" / "still")
    folder.time_file("wide").write_text("")
    folder.box_file("tall").unlink()
    run(night_clip, tmp_path)
    manifest = folder.manifest()
    assert manifest is not None
    assert manifest.sessions[-1].finished


def test_threads_are_restored(night_clip: Path, tmp_path: Path) -> None:
    import torch

    before = torch.get_num_threads()
    run(night_clip, tmp_path, threads=before + 1)
    assert torch.get_num_threads() == before


def test_no_more_workers_are_planned_for_than_there_are_jobs(
    night_clip: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    planned: list[int] = []

    def plan_units(*given: Any, workers: int, **settings: Any) -> Any:
        planned.append(workers)
        return planning.plan_units(*given, workers=workers, **settings)

    def run_in_workers(units: Any, workers: int, _setting: Any, progress: Any) -> Any:
        planned.append(workers)
        return run_in_process(units, Trackers(), progress)

    monkeypatch.setattr(benchmark, "plan_units", plan_units)
    monkeypatch.setattr(benchmark, "run_in_workers", run_in_workers)
    assert run(night_clip, tmp_path, "still still@b", workers=10**6).tracked == 6
    assert planned == [6, 6]
