"""What is exported is read back as it was, as far as the layout keeps it."""

import json
import zipfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from nat2024.errors import BoxFileError, DatasetNotFound, ResultConflict, UsageError
from nat2024.exporting import FORMATS, export_results
from nat2024.store import (
    DatasetRecord,
    Manifest,
    PluginRecord,
    RunFolder,
    Track,
    dataset_folder,
    list_runs,
)
from nat2024.types import Dataset, Sequence

RUNS = (("mil", "none"), ("siamrpnpp@a.1", "gamma@soft"), ("dimp50", "none"))


class Frames:
    """Frames that nobody looks at."""

    frame_size = (100, 100)

    def __init__(self, count: int) -> None:
        self.count = count

    def __len__(self) -> int:
        return self.count

    def __getitem__(self, index: int) -> np.ndarray:
        raise IndexError(index)


def plugin(title: str) -> PluginRecord:
    name, _, label = title.partition("@")
    return PluginRecord(name, label)


def store(results: Path, boxes: dict[str, np.ndarray]) -> None:
    for tracker, enhancer in RUNS:
        manifest = Manifest(
            dataset=DatasetRecord("clip", "/data/clip"),
            tracker=plugin(tracker),
            enhancer=None if enhancer == "none" else plugin(enhancer),
        )
        folder = RunFolder(results / "clip" / manifest.run)
        for name, rows in boxes.items():
            seconds = np.arange(3 * len(rows)).reshape(-1, 3) / 64
            folder.write(name, Track(rows, seconds))
        folder.write_manifest(manifest)


@pytest.fixture
def boxes() -> dict[str, np.ndarray]:
    random = np.random.default_rng(0)
    return {name: random.uniform(-5, 500, (n, 4)) for name, n in (("car1", 7), ("person_2", 4))}


@pytest.fixture
def results(tmp_path: Path, boxes: dict[str, np.ndarray]) -> Path:
    store(tmp_path / "results", boxes)
    return tmp_path / "results"


def dataset_of(boxes: dict[str, np.ndarray], offset: float = 0.0) -> Dataset:
    moved = {n: rows + np.array([offset, offset, 0, 0]) for n, rows in boxes.items()}
    return Dataset("clip", tuple(Sequence(n, Frames(len(b)), b) for n, b in moved.items()))


def read_back(out: Path, form: str) -> dict[str, dict[str, np.ndarray]]:
    place = out / "clip.zip" if form == "bundle" else out
    runs = list_runs(dataset_folder(place, "clip"))
    return {
        f"{run.tracker}+{run.enhancer}": {n: run.boxes(n) for n in run.finished()} for run in runs
    }


def expected(form: str, rows: np.ndarray) -> np.ndarray:
    if form == "got10k":
        return np.array([[float(f"{value:.3f}") for value in row] for row in rows.tolist()])
    return np.trunc(rows) if form == "pytracking" else rows


@pytest.mark.parametrize("form", FORMATS)
def test_own_to_each_to_own(
    results: Path, tmp_path: Path, boxes: dict[str, np.ndarray], form: str
) -> None:
    report = export_results(results / "clip", form, tmp_path / "out")
    assert report.ok
    assert (report.dataset, report.format) == ("clip", form)
    assert [run.sequences for run in report.runs] == [2, 2, 2]
    back = read_back(tmp_path / "out", form)
    assert sorted(back) == sorted(f"{tracker}+{enhancer}" for tracker, enhancer in RUNS)
    for found in back.values():
        assert sorted(found) == sorted(boxes)
        for name, rows in boxes.items():
            np.testing.assert_array_equal(found[name], expected(form, rows))
    # and home again: the boxes of the layout, under our own names
    place = tmp_path / "out" / "clip.zip" if form == "bundle" else tmp_path / "out"
    export_results(dataset_folder(place, "clip"), "nat-bench", tmp_path / "home")
    (home,) = (tmp_path / "home").iterdir()
    assert sorted(p.name for p in home.iterdir()) == ["dimp50", "mil", "siamrpnpp@a.1+gamma@soft"]
    for run in list_runs(home):
        assert isinstance(run, RunFolder)
        for name, rows in boxes.items():
            np.testing.assert_array_equal(run.boxes(name), expected(form, rows))


@given(
    rows=arrays(
        np.float64,
        st.tuples(st.integers(1, 5), st.just(4)),
        elements=st.floats(allow_nan=True, allow_infinity=True, width=64),
    )
)
@settings(
    max_examples=15,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
def test_every_number_survives_where_the_layout_keeps_it(
    tmp_path_factory: pytest.TempPathFactory, rows: np.ndarray
) -> None:
    folder = tmp_path_factory.mktemp("any")
    store(folder / "results", {"a": rows})
    for form in ("pysot", "bundle", "nat-bench"):
        export_results(folder / "results" / "clip", form, folder / form, runs=["mil"])
        (found,) = read_back(folder / form, form).values()
        np.testing.assert_array_equal(found["a"], rows)
        assert (np.signbit(found["a"]) == np.signbit(rows))[np.isfinite(rows)].all()


@pytest.mark.parametrize("form", ["got10k", "pytracking", "bundle"])
def test_times_go_along(results: Path, tmp_path: Path, form: str) -> None:
    export_results(results / "clip", form, tmp_path / "out", runs=["mil"])
    place = tmp_path / "out" / "clip.zip" if form == "bundle" else tmp_path / "out"
    (run,) = list_runs(dataset_folder(place, "clip"))
    seconds = np.arange(12).reshape(-1, 3) / 64
    found = run.frame_seconds("person_2")
    assert found is not None
    np.testing.assert_allclose(found, seconds[:, 1:].sum(axis=1), rtol=0, atol=1e-6)


def test_whole_pixels_cannot_be_nan(results: Path, tmp_path: Path) -> None:
    rows = np.array([[1.9, -1.9, 3, 4], [np.nan] * 4])
    RunFolder(results / "clip" / "mil").write("gone", Track(rows, np.empty((0, 3))))
    report = export_results(results / "clip", "pytracking", tmp_path / "out", runs=["mil"])
    assert not report.ok
    (run,) = report.runs
    assert run.left_out == {"gone": "1 rows are not finite, and this layout has whole numbers only"}
    assert run.sequences == 2
    assert "whole pixels" in report.loses


def test_repeats_become_labelled_runs(tmp_path: Path) -> None:
    for number in (1, 2):
        path = tmp_path / "GOT-10k" / "HiFT_SCT" / "a" / f"a_{number:03d}.txt"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(f"{number},0,5,5\n{number},1,5,5\n")
    report = export_results(tmp_path / "GOT-10k", "nat-bench", tmp_path / "out")
    assert [run.run for run in report.runs] == ["HiFT_SCT-r1", "HiFT_SCT-r2"]
    first, second = list_runs(tmp_path / "out" / "GOT-10k")
    assert (first.name, second.name) == ("hift@r1+sct", "hift@r2+sct")
    assert [run.boxes("a")[0, 0] for run in (first, second)] == [1, 2]
    assert (first.tracker, first.enhancer) == ("hift@r1", "sct")


def test_foreign_names_that_are_no_names_of_ours_keep_their_enhancer(tmp_path: Path) -> None:
    for run in ("SiamFC++_LIME", "SiamRPN++", "siamrpn_alex_dwxcorr"):
        path = tmp_path / "UAVDark135" / run / "a.txt"
        path.parent.mkdir(parents=True)
        path.write_text("1,2,3,4\n")
    export_results(tmp_path / "UAVDark135", "nat-bench", tmp_path / "out")
    runs = list_runs(tmp_path / "out" / "UAVDark135")
    assert [(run.tracker, run.enhancer) for run in runs] == [
        ("SiamFC++", "lime"),
        ("siamrpnpp", "none"),
        ("siamrpnpp@2", "none"),
    ]
    manifest = runs[1].manifest()
    assert manifest is not None
    assert manifest.imported is not None
    assert (manifest.imported.name, manifest.imported.layout) == ("SiamRPN++", "texts")


def test_results_that_do_not_fit_the_dataset_are_named(
    results: Path, tmp_path: Path, boxes: dict[str, np.ndarray]
) -> None:
    folder = RunFolder(results / "clip" / "mil")
    folder.write("Human4-2", Track(np.ones((3, 4)), np.empty((0, 3))))
    folder.write("car1", Track(np.ones((6, 4)), np.empty((0, 3))))
    (results / "clip" / "dimp50" / "car1.txt").write_text("")
    known = {**boxes, "Human4_2": np.ones((3, 4))}
    report = export_results(results, "pysot", tmp_path / "out", dataset=dataset_of(known))
    dimp, mil, _ = report.runs
    assert mil.left_out == {
        "Human4-2": "clip has no sequence Human4-2; closest: Human4_2",
        "car1": "6 rows, but the sequence has 7 frames; the tracker may have left out the first "
        "frame",
    }
    assert "no boxes in it" in dimp.left_out["car1"]
    assert (mil.sequences, dimp.sequences) == (1, 1)


def test_zero_based_rows_are_shifted_when_asked(
    results: Path, tmp_path: Path, boxes: dict[str, np.ndarray]
) -> None:
    dataset = dataset_of(boxes, offset=1.0)
    kept = export_results(results, "pysot", tmp_path / "kept", dataset=dataset)
    assert "0-based" in kept.runs[0].remarks[0]
    moved = export_results(results, "pysot", tmp_path / "moved", dataset=dataset, shift_origin=True)
    assert moved.runs[0].remarks == ("all rows shifted by (+1, +1) px",)
    for form, shift in (("kept", 0.0), ("moved", 1.0)):
        for run in read_back(tmp_path / form, "pysot").values():
            for name, rows in boxes.items():
                np.testing.assert_array_equal(run[name], rows + np.array([shift, shift, 0, 0]))


def test_only_the_minus_one_kind_is_shifted(
    results: Path, tmp_path: Path, boxes: dict[str, np.ndarray]
) -> None:
    half = dataset_of(boxes, offset=-0.5)
    report = export_results(results, "pysot", tmp_path / "out", dataset=half, shift_origin=True)
    assert "as the testers of pysot" in report.runs[0].remarks[0]
    np.testing.assert_array_equal(
        read_back(tmp_path / "out", "pysot")["mil+none"]["car1"], boxes["car1"]
    )


def test_a_bundle_is_one_file_with_hashes(results: Path, tmp_path: Path) -> None:
    for number in (1, 2):
        export_results(results / "clip", "bundle", tmp_path / f"out{number}")
    first, second = (tmp_path / f"out{number}" / "clip.zip" for number in (1, 2))
    assert first.read_bytes() == second.read_bytes()
    with zipfile.ZipFile(first) as archive:
        manifest = json.loads(archive.read("manifest.json"))
        assert (manifest["dataset"], manifest["protocol"]) == ("clip", "pysot")
        assert [run["run"] for run in manifest["runs"]] == sorted(
            ["mil", "dimp50", "siamrpnpp@a.1+gamma@soft"]
        )
        assert archive.read("boxes/mil/car1.csv").startswith(b"x,y,w,h\n")
    changed = tmp_path / "changed.zip"
    with zipfile.ZipFile(first) as old, zipfile.ZipFile(changed, "w") as new:
        for name in old.namelist():
            text = old.read(name)
            new.writestr(name, text + b"1,1,1,1\n" if name == "boxes/mil/car1.csv" else text)
    run = next(run for run in list_runs(changed) if run.name == "mil")
    with pytest.raises(BoxFileError, match="altered since it was exported"):
        run.boxes("car1")
    assert len(run.boxes("person_2")) == 4


@pytest.mark.parametrize("changes", [{"dataset": "../out"}, {"runs": "../../out"}])
def test_names_in_a_manifest_lead_nowhere(
    results: Path, tmp_path: Path, changes: dict[str, str]
) -> None:
    export_results(results / "clip", "bundle", tmp_path / "out", runs=["mil"])
    evil = tmp_path / "evil.zip"
    with zipfile.ZipFile(tmp_path / "out" / "clip.zip") as old, zipfile.ZipFile(evil, "w") as new:
        manifest = json.loads(old.read("manifest.json"))
        if "dataset" in changes:
            manifest["dataset"] = changes["dataset"]
        else:
            manifest["runs"][0]["run"] = changes["runs"]
        for name in old.namelist():
            new.writestr(name, old.read(name))
    _replace(evil, "manifest.json", json.dumps(manifest))
    for form in FORMATS:
        with pytest.raises(ResultConflict, match="is no name of a folder"):
            export_results(evil, form, tmp_path / "deep" / "er")
    assert not (tmp_path / "deep").exists()


def _replace(archive: Path, member: str, text: str) -> None:
    with zipfile.ZipFile(archive) as old:
        kept = {name: old.read(name) for name in old.namelist() if name != member}
    with zipfile.ZipFile(archive, "w") as new:
        for name, data in {**kept, member: text.encode()}.items():
            new.writestr(name, data)


def test_runs_that_are_called_alike_stay_apart(tmp_path: Path) -> None:
    for number, run in enumerate(("SiamRPN++", "siamrpn_alex_dwxcorr")):
        path = tmp_path / "UAVDark135" / run / "a.txt"
        path.parent.mkdir(parents=True)
        path.write_text(f"{number},2,3,4\n")
    for form in FORMATS:
        report = export_results(tmp_path / "UAVDark135", form, tmp_path / form)
        if form != "bundle":
            assert len({run.path for run in report.runs}) == 2


def test_wrong_use(results: Path, tmp_path: Path) -> None:
    folder = results / "clip"
    with pytest.raises(UsageError, match="no format 'pysto'; closest: pysot"):
        export_results(folder, "pysto", tmp_path / "out")
    with pytest.raises(UsageError, match="no run 'mill'; closest: mil"):
        export_results(folder, "pysot", tmp_path / "out", runs=["mill"])
    with pytest.raises(UsageError, match="needs the annotation"):
        export_results(folder, "pysot", tmp_path / "out", shift_origin=True)
    with pytest.raises(DatasetNotFound, match="holds no results"):
        export_results(tmp_path / "absent", "pysot", tmp_path / "out")
    export_results(folder, "pysot", tmp_path / "out")
    with pytest.raises(ResultConflict, match="is there already"):
        export_results(folder, "pysot", tmp_path / "out")
