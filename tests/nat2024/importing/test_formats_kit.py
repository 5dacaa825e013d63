"""The same three sequences in the layouts of the toolkits themselves, inside one archive."""

import io
import zipfile
from pathlib import Path

import numpy as np
import pytest

from nat2024.boxes import parse_boxes
from nat2024.errors import BoxFileError
from nat2024.importing import compare_first_rows, find_groups, find_runs

pytestmark = pytest.mark.shared

NAMES = ["Car2", "Motor2", "Wakeboarding2"]


@pytest.fixture(scope="module")
def kit(shared: Path) -> Path:
    return shared / "parity" / "metrics" / "formats.zip"


def lines(kit: Path, name: str) -> list[str]:
    return zipfile.ZipFile(kit).read(name).decode().splitlines()


def truth(kit: Path) -> dict[str, np.ndarray]:
    return {name: parse_boxes("\n".join(lines(kit, f"anno/{name}.txt")))[0] for name in NAMES}


@pytest.mark.parametrize(
    ("folder", "layout", "run", "file", "decimals"),
    [
        ("pysot/results/DTB70", "texts", "SiamAPN++", "SiamAPN++/{}.txt", None),
        ("got10k/results/GOT-10k", "got10k", "SiamAPN++", "SiamAPN++/{0}/{0}_001.txt", 3),
        ("got10k_ope/results/DTB70", "texts", "SiamAPN++", "SiamAPN++/{}.txt", 3),
        ("lasot/tracking_results", "texts", "SiamAPN++", "SiamAPN++_tracking_result/{}.txt", None),
        ("pytracking/tracking_results", "pytracking", "siamapnpp", "", 0),
    ],
)
def test_every_layout_gives_the_same_boxes(
    kit: Path, folder: str, layout: str, run: str, file: str, decimals: int | None
) -> None:
    (found,) = find_runs(kit / folder)
    assert (found.layout, found.name, found.finished()) == (layout, run, NAMES)
    assert (found.tracker, found.enhancer) == ("siamapnpp", "none")
    (pysot,) = find_runs(kit / "pysot" / "results" / "DTB70")
    for name in NAMES:
        boxes = found.boxes(name)
        if file:
            plain = np.loadtxt(
                io.StringIO("\n".join(lines(kit, f"{folder}/{file.format(name)}"))), delimiter=","
            )
            assert boxes.tobytes() == plain.tobytes()
        exact = pysot.boxes(name)
        if decimals is None:
            np.testing.assert_array_equal(boxes, exact)
        elif decimals:
            np.testing.assert_allclose(boxes, exact, rtol=0, atol=0.000501)
        else:
            np.testing.assert_array_equal(boxes, np.trunc(exact))


def test_times(kit: Path) -> None:
    for folder in ("got10k/results/GOT-10k", "got10k_ope/results/DTB70"):
        (run,) = find_runs(kit / folder)
        seconds = run.frame_seconds("Motor2")
        assert seconds is not None
        assert seconds[:2].tolist() == [0.012781, 0.015443]
        assert len(seconds) == len(run.boxes("Motor2"))


def test_first_rows_tell_the_writer(kit: Path) -> None:
    told = {}
    for folder in ("pysot/results/DTB70", "pytracking/tracking_results", "otb_matlab/results_OPE"):
        (run,) = find_runs(kit / folder)
        rows = compare_first_rows({n: run.boxes(n)[0] for n in NAMES}, truth(kit))
        assert rows is not None
        assert not rows.others
        told[folder.partition("/")[0]] = (rows.offset, rows.alike)
    assert told["pysot"] == ((0.5, 0.5), True)
    assert told["pytracking"] == ((0.0, 0.0), True)
    assert told["otb_matlab"] == ((-0.5, -0.5), False)


def test_matlab_equals_the_expected_text(kit: Path) -> None:
    (run,) = find_runs(kit / "otb_matlab" / "results_OPE")
    assert (run.name, run.layout, run.finished()) == ("AutoTrack", "otb-matlab", NAMES)
    for name in NAMES:
        text = "\n".join(lines(kit, f"otb_matlab/expected_text/AutoTrack/{name}.txt"))
        np.testing.assert_array_equal(run.boxes(name), parse_boxes(text))


def test_a_warp_is_refused_with_its_type(kit: Path) -> None:
    (run,) = find_runs(kit / "otb_matlab" / "non_rect_ivtAff")
    assert (run.name, run.finished()) == ("FCNT", ["S0601"])
    with pytest.raises(BoxFileError, match="results of the type ivtAff, which are no boxes"):
        run.boxes("S0601")


def test_vot_is_refused_unless_told(kit: Path) -> None:
    (run,) = find_runs(kit / "vot" / "results" / "VOT")
    with pytest.raises(BoxFileError, match="started anew after each failure"):
        run.boxes("Motor2")
    rows = run.one_pass().boxes("Motor2")
    (pysot,) = find_runs(kit / "pysot" / "results" / "DTB70")
    exact = pysot.boxes("Motor2")
    assert len(rows) == len(exact)
    without = np.flatnonzero(np.isnan(rows).any(axis=1)).tolist()
    assert without == [0, *range(9, 15)]  # started, failed, skipped, started again
    kept = ~np.isnan(rows).any(axis=1)
    np.testing.assert_allclose(rows[kept], exact[kept], rtol=0, atol=0.0000501)


def test_all_groups_of_the_archive_are_found(kit: Path) -> None:
    assert [str(group.relative_to(kit)) for group in find_groups(kit)] == [
        "got10k/results/GOT-10k",
        "got10k_ope/results/DTB70",
        "lasot/tracking_results",
        "otb_matlab",
        "otb_matlab/expected_text",
        "otb_matlab/results_OPE",
        "pysot/results/DTB70",
        "pytracking/tracking_results",
        "vot/results/VOT",
    ]
