"""Result files: what is written is read back, and no two settings share a folder."""

from pathlib import Path

import numpy as np
import pytest

from nat2024.errors import DatasetNotFound, ResultConflict
from nat2024.store import (
    DatasetRecord,
    Manifest,
    PluginRecord,
    RunFolder,
    Track,
    WeightsRecord,
    dataset_folder,
    list_datasets,
    list_runs,
    open_run,
    run_name,
    split_run_name,
)


def manifest(**changes: object) -> Manifest:
    settings: dict[str, object] = {
        "dataset": DatasetRecord("clip", "clip"),
        "tracker": PluginRecord("mil", options={"scope": "frame"}),
        "enhancer": PluginRecord(
            "gamma", "soft", {"gamma": 0.5}, WeightsRecord("given", "a.pth", "ab" * 32)
        ),
        "scope": "frame",
    }
    return Manifest(**{**settings, **changes})  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("tracker", "enhancer", "name"),
    [
        ("mil", "none", "mil"),
        ("mil@a", "none", "mil@a"),
        ("siamrpnpp", "ldenhancer", "siamrpnpp+ldenhancer"),
        ("siamrpnpp@a.1", "ldenhancer@epoch-99", "siamrpnpp@a.1+ldenhancer@epoch-99"),
    ],
)
def test_run_names_go_both_ways(tracker: str, enhancer: str, name: str) -> None:
    assert run_name(tracker, enhancer) == name
    assert split_run_name(name) == (tracker, enhancer)


def test_a_foreign_folder_name_is_taken_whole() -> None:
    assert split_run_name("LDE-SiamRPN++") == ("LDE-SiamRPN++", "none")


def test_tracks_round_trip_and_boxes_are_written_last(tmp_path: Path) -> None:
    boxes = np.array([[1.5, 2, 3, 4], [0.1 + 0.2, -0.0, 1e-300, 1e17]])
    seconds = np.array([[0.001, 0.0, 0.25], [0.002, 0.5, 0.125]])
    folder = RunFolder(tmp_path / "mil")
    folder.write("a b", Track(boxes, seconds))
    assert folder.finished() == ["a b"]
    assert folder.boxes("a b").tobytes() == boxes.tobytes()
    np.testing.assert_array_equal(folder.seconds("a b"), seconds)
    assert folder.time_file("a b").read_text().startswith("read,enhance,track\n0.001000,0.0")
    assert not [p for p in tmp_path.rglob("*.tmp")]


def test_stage_times_keep_the_first_frame_apart(tmp_path: Path) -> None:
    folder = RunFolder(tmp_path / "mil")
    seconds = np.array([[9.0, 9.0, 9.0], [0.1, 0.2, 0.3], [0.1, 0.2, 0.3]])
    folder.write("a", Track(np.ones((3, 4)), seconds))
    times = folder.stage_times()
    assert times is not None
    assert (times.frames, times.read, times.enhance, times.track) == (3, 0.1, 0.2, 0.3)
    assert times.first_frame == 27.0
    assert times.frames_per_second == 2.0
    assert times.end_to_end_frames_per_second == round(1 / 0.6, 3)
    assert RunFolder(tmp_path / "nothing").stage_times() is None


def test_manifests_round_trip(tmp_path: Path) -> None:
    folder = RunFolder(tmp_path / "mil+gamma@soft")
    assert folder.manifest() is None
    folder.write_manifest(manifest())
    assert folder.manifest() == manifest()
    assert manifest().run == folder.name


def test_the_same_settings_go_on_in_the_same_folder(tmp_path: Path) -> None:
    folder = RunFolder(tmp_path / "run")
    assert open_run(folder, manifest()) == manifest()
    folder.write_manifest(manifest(failures={"a": "broken frame"}))
    assert open_run(folder, manifest()).failures == {"a": "broken frame"}


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"enhancer": PluginRecord("gamma", "soft", {"gamma": 0.4})}, r"gamma@soft.gamma 0.5"),
        ({"scope": "patch"}, r"scope frame \(now patch\)"),
        ({"device": "cuda"}, r"device cpu \(now cuda\)"),
        ({"threads": 2}, r"threads 1 \(now 2\)"),
        (
            {
                "enhancer": PluginRecord(
                    "gamma", "soft", {"gamma": 0.5}, WeightsRecord("given", "b.pth", "cd" * 32)
                )
            },
            r"weights of gamma@soft abababababab \(now cdcdcdcdcdcd\)",
        ),
    ],
)
def test_other_settings_are_refused_and_named(
    tmp_path: Path, changes: dict[str, object], told: str
) -> None:
    folder = RunFolder(tmp_path / "run")
    folder.write_manifest(manifest())
    with pytest.raises(ResultConflict, match=told) as caught:
        open_run(folder, manifest(**changes))
    assert "give this run a label (mil@LABEL)" in str(caught.value)


def test_weights_that_only_moved_are_the_same(tmp_path: Path) -> None:
    folder = RunFolder(tmp_path / "run")
    folder.write_manifest(manifest())
    moved = PluginRecord(
        "gamma", "soft", {"gamma": 0.5}, WeightsRecord("given", "elsewhere.pth", "ab" * 32)
    )
    open_run(folder, manifest(enhancer=moved))


def test_scope_means_nothing_without_an_enhancer(tmp_path: Path) -> None:
    folder = RunFolder(tmp_path / "run")
    folder.write_manifest(manifest(enhancer=None, scope="patch"))
    open_run(folder, manifest(enhancer=None, scope="frame"))


def test_results_without_a_manifest_are_not_added_to(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text("1,2,3,4\n")
    with pytest.raises(ResultConflict, match=r"results without run\.json"):
        open_run(RunFolder(tmp_path), manifest())


def test_an_unreadable_manifest_is_told(tmp_path: Path) -> None:
    (tmp_path / "run.json").write_text('{"dataset": 3}')
    with pytest.raises(ResultConflict, match=r"run\.json: not a manifest of this version"):
        RunFolder(tmp_path).manifest()


def test_folders_are_found_from_results_or_from_the_dataset_folder(tmp_path: Path) -> None:
    RunFolder(tmp_path / "clip" / "mil").write("a", Track(np.ones((2, 4)), np.ones((2, 3))))
    assert [folder.name for folder in list_datasets(tmp_path)] == ["clip"]
    assert [run.name for run in list_runs(tmp_path / "clip")] == ["mil"]
    assert dataset_folder(tmp_path, "clip") == tmp_path / "clip"
    assert dataset_folder(tmp_path / "clip", "other") == tmp_path / "clip"
    assert dataset_folder(tmp_path / "clip", "mil") == tmp_path / "clip"  # a run of that name
    RunFolder(tmp_path / "clip" / "mil").write_manifest(manifest())
    with pytest.raises(DatasetNotFound, match="this is one run; name the folder of its dataset"):
        dataset_folder(tmp_path / "clip" / "mil", "clip")
    with pytest.raises(DatasetNotFound, match=r"no results of other; it holds clip"):
        dataset_folder(tmp_path, "other")
    with pytest.raises(DatasetNotFound, match="no such results folder"):
        dataset_folder(tmp_path / "absent", "clip")
