"""Every layout is told by its shape, in a folder and in an archive."""

import contextlib
import io
import logging
import pickle
import shutil
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from nat2024.errors import BoxFileError, DatasetNotFound
from nat2024.importing import find_groups, find_runs
from nat2024.importing.names import split_name
from nat2024.store import RunFolder, dataset_folder, list_datasets, list_runs
from tests.nat2024.importing.conftest import BOXES, text

Put = Callable[[str, str | bytes], Path]
Pack = Callable[[Path, Path], Path]


def pysot(put: Put, run: str = "UAVDark135/LDE-HiFT", **changes: str) -> None:
    for name, rows in BOXES.items():
        put(f"results/{run}/{name}.txt", text(rows, **changes))


def test_pysot(put: Put, tmp_path: Path) -> None:
    pysot(put)
    put("results/UAVDark135/LDE-HiFT.txt", "Time: 12.1s, Speed: 33.2\n")
    put("results/UAVDark135/eval_data.pkl", pickle.dumps(["never opened"]))
    (run,) = list_runs(tmp_path / "results" / "UAVDark135")
    assert (run.name, run.tracker, run.enhancer) == ("LDE-HiFT", "hift", "ldenhancer")
    assert run.finished() == ["car1", "person_2"]
    assert run.boxes("car1").tobytes() == BOXES["car1"].tobytes()
    assert run.frame_seconds("car1") is None
    assert run.manifest() is None
    assert dataset_folder(tmp_path / "results", "uavdark135").name == "UAVDark135"
    assert dataset_folder(tmp_path, "uavdark135").name == "UAVDark135"


def test_times_beside_and_apart(put: Put, tmp_path: Path) -> None:
    pysot(put, "NAT2021/SiamFC++")
    put("results/NAT2021/SiamFC++/times/car1_time.txt", "0.5\n0.25\n0.25\n")
    pysot(put, "NAT2021/dimp50_DCE", separator="\t", form=".0f")
    put("results/NAT2021/dimp50_DCE/person_2_time.txt", "0.5\n0.125\n")
    put("results/NAT2021/dimp50_DCE/person_2_object_presence_scores.txt", "1\n1\n")
    fc, dimp = list_runs(tmp_path / "results" / "NAT2021")
    assert fc.finished() == dimp.finished() == ["car1", "person_2"]
    assert fc.frame_seconds("car1").tolist() == [0.5, 0.25, 0.25]  # type: ignore[union-attr]
    assert dimp.frame_seconds("person_2").tolist() == [0.5, 0.125]  # type: ignore[union-attr]
    assert (dimp.tracker, dimp.enhancer) == ("dimp50", "dce")
    # tabs and times alone do not make a folder of results a tracker of pytracking
    assert [p.name for p in list_datasets(tmp_path / "results")] == ["NAT2021"]
    assert [run.name for run in list_runs(tmp_path / "results")] == []


def test_results_of_many_trackers_by_tabs_are_not_parameters_of_one(
    put: Put, tmp_path: Path
) -> None:
    for run in ("dimp50", "dimp50_DarkLighter"):
        pysot(put, run, separator="\t", form=".0f")
        put(f"results/{run}/car1_time.txt", "1\n1\n1\n")
    assert [r.name for r in find_runs(tmp_path / "results")] == ["dimp50", "dimp50_DarkLighter"]
    assert find_runs(tmp_path) == []


def test_got10k_with_repeats(put: Put, tmp_path: Path) -> None:
    for name, rows in BOXES.items():
        for repeat in (1, 2, 3):
            moved = rows + np.array([repeat, 0, 0, 0])
            put(f"GOT-10k/SiamFC/{name}/{name}_{repeat:03d}.txt", text(moved, form=".3f"))
        times = "".join("0.5,1.5,0\n" for _ in rows)
        put(f"GOT-10k/SiamFC/{name}/{name}_time.txt", times)
    (run,) = find_runs(tmp_path / "GOT-10k")
    assert (run.layout, run.name) == ("got10k", "SiamFC")
    assert [boxes[0, 0] for boxes in run.repeats("car1")] == [11.5, 12.5, 13.5]
    assert run.boxes("car1")[0, 0] == 11.5
    # a column of zeros is a repeat that was not timed
    assert run.frame_seconds("person_2").tolist() == [1.0, 1.0]  # type: ignore[union-attr]


def pytracking(put: Put, folder: str, shift: int = 0, times: bool = True) -> None:
    for name, rows in BOXES.items():
        whole = np.trunc(rows) + np.array([shift, 0, 0, 0])
        put(f"{folder}/{name}.txt", text(whole, separator="\t", form=".0f"))
        if times:
            put(f"{folder}/{name}_time.txt", "0.100000\n" * len(rows))
        put(f"{folder}/{name}_object_presence_scores.txt", "0.9\n" * len(rows))


def test_pytracking(put: Put, tmp_path: Path) -> None:
    pytracking(put, "tracking_results/dimp/dimp50_000")
    pytracking(put, "tracking_results/dimp/dimp50_001", shift=2)
    pytracking(put, "tracking_results/tomp/default", times=False)
    pytracking(put, "tracking_results/kys/default/UAVDark135")
    pytracking(put, "tracking_results/kys/default/NAT2021")
    runs = {run.name: run for run in find_runs(tmp_path / "tracking_results")}
    assert list(runs) == ["dimp50", "kys-NAT2021", "kys-UAVDark135", "tomp"]
    assert {run.layout for run in runs.values()} == {"pytracking"}
    assert runs["dimp50"].finished() == ["car1", "person_2"]
    assert [b[0, 0] for b in runs["dimp50"].repeats("car1")] == [10, 12]
    assert runs["kys-NAT2021"].tracker == "kys"
    assert runs["kys-NAT2021"].dataset == "NAT2021"
    assert dataset_folder(tmp_path, "anything") == tmp_path / "tracking_results"


def test_vot(put: Put, tmp_path: Path) -> None:
    put("VOT/SiamRPN++/baseline/car1/car1_001.txt", "1\n1.5,2,3,4\n2\n0\n1\n5,6,7,8\n")
    put("VOT/LTMU/longterm/bag/bag_001.txt", "1\n1,2,3,4\nnan,nan,nan,nan\n0,0,0,0\n")
    put("VOT/LTMU/longterm/bag/bag_001_confidence.value", "\n0.5\n0.1\n0.0\n")
    put("VOT/LTMU/longterm/bag/bag_time.txt", "0.1\n0.1\n0.1\n0.1\n")
    long_term, short_term = find_runs(tmp_path / "VOT")
    assert (long_term.layout, short_term.layout) == ("vot-longterm", "vot-baseline")
    rows = long_term.boxes("bag")
    assert np.isnan(rows[[0, 2]]).all()
    assert rows[[1, 3]].tolist() == [[1, 2, 3, 4], [0, 0, 0, 0]]
    with pytest.raises(BoxFileError, match=r"car1_001\.txt: a VOT short-term result.*accept-rest"):
        short_term.boxes("car1")
    told = short_term.one_pass().boxes("car1")
    assert np.isnan(told[[0, 2, 3, 4]]).all()
    assert told[5].tolist() == [5, 6, 7, 8]


def test_polygons_of_vot_become_boxes(put: Put, tmp_path: Path) -> None:
    put("VOT/T/baseline/a/a_001.txt", "1\n1,1,3,1,3,5,1,5\n")
    (run,) = find_runs(tmp_path / "VOT")
    assert run.one_pass().boxes("a")[1].tolist() == [1, 1, 2, 4]


def matlab(results: object) -> bytes:
    from scipy.io import savemat

    raw = io.BytesIO()
    savemat(raw, {"results": results, "other": "workspace"})
    return raw.getvalue()


def cell(results: object) -> np.ndarray:
    one = np.empty((1, 1), dtype=object)
    one[0, 0] = results
    return one


def rect(rows: np.ndarray, **changes: object) -> dict[str, object]:
    return {"res": rows, "type": "rect", "len": len(rows), "fps": 30.0, **changes}


def test_matlab_in_folders_and_flat(put: Put, tmp_path: Path) -> None:
    put("ope/AutoTrack/car1_AutoTrack.mat", matlab(rect(BOXES["car1"])))
    put("ope/person_2_ARCF.mat", matlab(cell(rect(BOXES["person_2"]))))
    put("ope/car1_ARCF.mat", matlab(rect(BOXES["car1"][:1])))
    arcf, auto = find_runs(tmp_path / "ope")
    assert (arcf.name, arcf.finished()) == ("ARCF", ["car1", "person_2"])
    assert (auto.name, auto.finished()) == ("AutoTrack", ["car1"])
    assert auto.boxes("car1").tobytes() == BOXES["car1"].tobytes()
    assert arcf.boxes("person_2").tobytes() == BOXES["person_2"].tobytes()
    assert arcf.boxes("car1").shape == (1, 4)


@pytest.mark.parametrize(
    ("results", "told"),
    [
        ({"res": np.ones((3, 6)), "type": "ivtAff", "len": 3}, "type ivtAff, which are no boxes"),
        ({"res": np.ones((6, 4)), "type": "4corner", "len": 3}, "type 4corner, which are no"),
        (rect(np.ones((3, 5))), "`res` is not n x 4"),
        (rect(np.ones((3, 4)), len=4), "`len` is 4, but `res` has 3 rows"),
        ({"rects": 3}, "no struct `results` with `type` and `res`"),
    ],
)
def test_other_matlab_files_are_refused_in_one_line(
    put: Put, tmp_path: Path, results: object, told: str
) -> None:
    path = put("ope/T/a_T.mat", matlab(results))
    (run,) = find_runs(tmp_path / "ope")
    with pytest.raises(BoxFileError, match=told) as caught:
        run.boxes("a")
    assert str(caught.value).startswith(str(path))


@pytest.mark.parametrize("content", [b"", b"no matlab", pickle.dumps({"results": 1}), b"\0" * 300])
def test_damaged_matlab_files(put: Put, tmp_path: Path, content: bytes) -> None:
    put("ope/T/a_T.mat", content)
    (run,) = find_runs(tmp_path / "ope")
    with pytest.raises(BoxFileError, match=r"a_T\.mat: "):
        run.boxes("a")


def test_an_archive_is_what_its_folder_is(put: Put, pack: Pack, tmp_path: Path) -> None:
    pysot(put)
    pytracking(put, "results/tracking_results/dimp/dimp50_000")
    put("results/ope/AutoTrack/car1_AutoTrack.mat", matlab(rect(BOXES["car1"])))
    archive = pack(tmp_path / "results", tmp_path / "all.zip")
    packed, plain = find_groups(archive), find_groups(tmp_path / "results")
    assert [p.relative_to(archive) for p in packed] == [
        p.relative_to(tmp_path / "results") for p in plain
    ]
    for one, other in zip(packed, plain, strict=True):
        for run, same in zip(find_runs(one), find_runs(other), strict=True):
            assert (run.name, run.layout, run.finished()) == (
                same.name,
                same.layout,
                same.finished(),
            )
            for name in run.finished():
                assert run.boxes(name).tobytes() == same.boxes(name).tobytes()
    assert dataset_folder(archive, "uavdark135") == archive / "UAVDark135"
    assert not list(tmp_path.glob("all*/"))  # nothing was unpacked


def test_one_archive_a_tracker(put: Put, pack: Pack, tmp_path: Path) -> None:
    pysot(put)
    folder = tmp_path / "results" / "UAVDark135"
    (tmp_path / "cdt").mkdir()
    pack(folder, tmp_path / "cdt" / "LDE-HiFT.zip")
    pack(folder / "LDE-HiFT", tmp_path / "cdt" / "SiamAPN++_SCT.zip")
    nested, flat = find_runs(tmp_path / "cdt")
    assert (nested.name, nested.enhancer) == ("LDE-HiFT", "ldenhancer")
    assert (flat.tracker, flat.enhancer) == ("siamapnpp", "sct")
    assert flat.boxes("car1").tobytes() == nested.boxes("car1").tobytes()
    # TrackingNet: the archive alone is one run
    (alone,) = list_runs(tmp_path / "cdt" / "SiamAPN++_SCT.zip")
    assert (alone.name, alone.finished()) == ("SiamAPN++_SCT", ["car1", "person_2"])


def test_attribute_files_are_no_results(put: Put, tmp_path: Path) -> None:
    """UDAT's raw results have `UAVDark70_att_LAI` beside the datasets."""
    pysot(put, "UAVDark70/HiFT")
    for name in BOXES:
        put(f"results/UAVDark70_att_LAI/{name}.txt", "1\n")
        put(f"results/labels/{name}.txt", "0,1,0,0,1\n")
    assert find_runs(tmp_path / "results") == []
    assert dataset_folder(tmp_path / "results", "uavdark70").name == "UAVDark70"


def test_a_folder_named_as_the_dataset_goes_first(put: Put, tmp_path: Path) -> None:
    pysot(put)
    pysot(put, "HiFT")
    assert dataset_folder(tmp_path / "results", "uavdark135").name == "UAVDark135"
    assert dataset_folder(tmp_path / "results", "uavdark70").name == "results"


def test_lasot_and_a_folder_of_sequences_alone(put: Put, tmp_path: Path) -> None:
    pysot(put, "SiamAPN++_tracking_result")
    (run,) = find_runs(tmp_path / "results")
    assert run.name == "SiamAPN++"
    (alone,) = find_runs(tmp_path / "results" / "SiamAPN++_tracking_result")
    assert alone.name == "SiamAPN++"
    assert find_runs(tmp_path / "results" / "SiamAPN++_tracking_result", single=False) == []


def test_mixed_folders_keep_what_can_be_read(
    put: Put, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    pysot(put)
    put("results/UAVDark135/SiamFC/car1/car1_001.txt", text(BOXES["car1"]))
    put("results/UAVDark135/SiamFC.pkl", b"\x80")
    put("results/UAVDark135/broken.zip", b"PK\x03\x04 no archive")
    put("results/UAVDark135/empty/readme.md", "nothing")
    put("results/UAVDark135/half/car1.txt", "")
    put("results/UAVDark135/half/person_2.txt", text(BOXES["person_2"]))
    put("results/UAVDark135/anno/car1.txt", text(BOXES["car1"]))
    with caplog.at_level(logging.WARNING, "nat2024"):
        runs = find_runs(tmp_path / "results" / "UAVDark135")
    assert [run.name for run in runs] == ["LDE-HiFT", "SiamFC", "half"]
    assert [r.getMessage() for r in caplog.records if "broken.zip" in r.getMessage()]
    with pytest.raises(BoxFileError, match=r"car1\.txt: no boxes in it"):
        runs[2].boxes("car1")
    assert runs[2].boxes("person_2").shape == (2, 4)


def test_names_are_unique(put: Put, tmp_path: Path) -> None:
    put("ope/AutoTrack/car1_AutoTrack.mat", matlab(rect(BOXES["car1"])))
    put("ope/person_2_AutoTrack.mat", matlab(rect(BOXES["person_2"])))
    first, second = find_runs(tmp_path / "ope")
    assert first.name != second.name
    assert first.tracker == second.tracker == "AutoTrack"


def unsafe(path: Path, name: str, data: bytes = b"1,2,3,4\n") -> Path:
    info = zipfile.ZipInfo(name)
    info.filename = name
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(info, data, compress_type=zipfile.ZIP_DEFLATED)
    return path


@pytest.mark.parametrize(
    ("name", "data", "told"),
    [
        ("../escape/a.txt", b"1,2,3,4\n", "leads out of its folder"),
        ("/etc/a.txt", b"1,2,3,4\n", "begins at a root"),
        ("T/a.txt", b"0" * 2**25 + b"\n", "that unpack to 33554433"),
    ],
)
def test_unsafe_archives_are_refused_and_the_rest_is_kept(
    put: Put, tmp_path: Path, caplog: pytest.LogCaptureFixture, name: str, data: bytes, told: str
) -> None:
    pysot(put)
    unsafe(tmp_path / "results" / "UAVDark135" / "bad.zip", name, data)
    with caplog.at_level(logging.WARNING, "nat2024"):
        runs = find_runs(tmp_path / "results" / "UAVDark135")
    assert [run.name for run in runs] == ["LDE-HiFT"]
    assert told in caplog.text


def test_a_result_file_has_a_largest_size(
    put: Put, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from nat2024.importing import tree

    pysot(put)
    monkeypatch.setattr(tree, "MAX_BYTES", 10)
    (run,) = find_runs(tmp_path / "results" / "UAVDark135")
    with pytest.raises(BoxFileError, match="too large for a result file"):
        run.boxes("car1")


def test_several_folders_of_one_dataset_must_be_told_apart(put: Put, tmp_path: Path) -> None:
    pysot(put, "a/UAVDark135/HiFT")
    pysot(put, "b/UAVDark135/HiFT")
    with pytest.raises(DatasetNotFound, match=r"several folders .* a/UAVDark135, b/UAVDark135"):
        dataset_folder(tmp_path / "results", "uavdark135")


def test_an_archive_in_an_archive_is_told(
    put: Put, pack: Pack, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    pysot(put)
    folder = tmp_path / "results" / "UAVDark135"
    pack(folder, folder / "inner.zip")
    archive = pack(tmp_path / "results", tmp_path / "outer.zip")
    with caplog.at_level(logging.WARNING, "nat2024"):
        assert [run.name for run in find_runs(archive / "UAVDark135")] == ["LDE-HiFT"]
    assert "inner.zip: an archive inside an archive is not read" in caplog.text


def test_only_pickles(put: Put, tmp_path: Path) -> None:
    put("results/eval_data.pkl", pickle.dumps([1]))
    with pytest.raises(DatasetNotFound, match=r"holds nothing; eval_data\.pkl may hold code"):
        dataset_folder(tmp_path / "results", "uavdark135")


def test_our_own_runs_lie_beside_foreign_ones(put: Put, tmp_path: Path) -> None:
    pysot(put)
    own = tmp_path / "results" / "UAVDark135" / "mil"
    shutil.copytree(tmp_path / "results" / "UAVDark135" / "LDE-HiFT", own)
    put("results/UAVDark135/mil/time/car1.csv", "read,enhance,track\n0,0.25,0.5\n0,1,1\n0,1,2\n")
    foreign, mine = list_runs(tmp_path / "results" / "UAVDark135")
    assert (foreign.name, mine.name) == ("LDE-HiFT", "mil")
    assert isinstance(mine, RunFolder)
    assert mine.frame_seconds("car1").tolist() == [0.75, 2, 3]  # type: ignore[union-attr]
    assert mine.frame_seconds("person_2") is None
    assert len(mine.repeats("car1")) == 1
    assert (mine.tracker, mine.enhancer) == split_name("mil")


def test_matlab_files_without_scipy_name_the_extra(
    put: Put, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    put("ope/T/a_T.mat", matlab(rect(BOXES["car1"])))
    (run,) = find_runs(tmp_path / "ope")
    monkeypatch.setitem(sys.modules, "scipy.io", None)
    with pytest.raises(BoxFileError, match=r'pip install "nat-bench\[matlab\]"'):
        run.boxes("a")


def test_a_file_is_no_results(put: Put, tmp_path: Path) -> None:
    path = put("eval_data.pkl", pickle.dumps([1]))
    with pytest.raises(DatasetNotFound, match=r"neither a folder of results nor a \.zip"):
        dataset_folder(path, "uavdark135")


NAMES = st.sampled_from(
    ["a", "a_001.txt", "a.txt", "baseline", "longterm", "times", "a_time.txt", "b_a.mat", "x.zip"]
    + ["manifest.json", "boxes", "default_000", "UAVDark135", "tracking_results", "anno", ".b", "ü"]
)
CONTENTS = st.one_of(
    st.sampled_from([b"", b"1,2,3,4\n", b"1\t2\t3\t4\n", b"1\n", b"{}", b"PK\x03\x04", b"\xff"]),
    st.binary(max_size=20),
)


@given(st.dictionaries(st.lists(NAMES, min_size=1, max_size=5).map("/".join), CONTENTS, max_size=8))
@settings(max_examples=60, deadline=None)
def test_any_folder_is_looked_at_without_an_accident(
    tmp_path_factory: pytest.TempPathFactory, files: dict[str, bytes]
) -> None:
    top = tmp_path_factory.mktemp("any")
    for name, content in files.items():
        path = top / name
        if not any(p.is_file() for p in (path, *path.parents)) and not path.is_dir():
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)
    for group in (top, *find_groups(top)):
        for run in find_runs(group):
            assert run.tracker
            for name in run.finished():
                run.frame_seconds(name)
                with contextlib.suppress(BoxFileError):
                    assert run.boxes(name).shape[1] == 4
