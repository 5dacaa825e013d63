import re

import pytest

from nat2024.errors import WeightsMismatch, WeightsMissing
from nat2024_trackers.opencv.nano import OpenCVNano
from nat2024_trackers.opencv.onnx_files import find_folder, find_pair


def fill(folder, *names):
    for name in names:
        (folder / name).write_bytes(b"")
    return folder


OFFICIAL = ("nanotrack_backbone_sim.onnx", "nanotrack_head_sim.onnx")
ALL = tuple(f"nanotrackv{v}_{part}.onnx" for v in (1, 2, 3) for part in ("backbone", "head"))


@pytest.mark.parametrize("variant", ["v1", "v2"])
def test_official_names_serve_any_variant(tmp_path, variant):
    pair = find_pair(fill(tmp_path, *OFFICIAL, "LICENSE.txt", "nanotrackv1.pth"), variant)
    assert (pair.backbone.name, pair.head.name) == OFFICIAL


@pytest.mark.parametrize("variant", ["v1", "v2"])
def test_of_several_versions_the_variant_is_chosen(tmp_path, variant):
    pair = find_pair(fill(tmp_path, *ALL), variant)
    assert pair.backbone.name == f"nanotrack{variant}_backbone.onnx"
    assert pair.head.name == f"nanotrack{variant}_head.onnx"


def test_a_version_in_the_name_goes_before_a_name_without(tmp_path):
    pair = find_pair(fill(tmp_path, *OFFICIAL, *ALL), "v2")
    assert pair.backbone.name == "nanotrackv2_backbone.onnx"


def test_other_spellings(tmp_path):
    pair = find_pair(fill(tmp_path, "NanoTrack_V2_Backbone.ONNX", "object_neckhead_v2.onnx"), "v2")
    assert (pair.backbone.name, pair.head.name) == (
        "NanoTrack_V2_Backbone.ONNX",
        "object_neckhead_v2.onnx",
    )


@pytest.mark.parametrize(
    ("names", "missing"),
    [
        (OFFICIAL[:1], "no *head*.onnx of NanoTrack v1 in it (it holds nanotrack_backbone_sim"),
        (OFFICIAL[1:], "no *backbone*.onnx of NanoTrack v1 in it (it holds nanotrack_head_sim"),
        ((), "no *backbone*.onnx and no *head*.onnx of NanoTrack v1 in it (it holds no ONNX file)"),
    ],
)
def test_a_missing_half_is_named(tmp_path, names, missing):
    with pytest.raises(WeightsMissing, match=re.escape(missing)):
        find_pair(fill(tmp_path, *names), "v1")


def test_files_of_version_3_cannot_run_in_opencvs_tracker(tmp_path):
    folder = fill(tmp_path, *ALL[4:])
    with pytest.raises(WeightsMismatch, match=r"v3, which OpenCV's tracker cannot.*of v1 or v2"):
        find_pair(folder, "v1", ("v1", "v2"))
    with pytest.raises(WeightsMismatch, match="is of NanoTrack v3; pass variant=v3"):
        find_pair(folder, "v1")
    assert find_pair(folder, "v3").head.name == "nanotrackv3_head.onnx"


def test_files_of_the_other_variant_say_which_to_pass(tmp_path):
    with pytest.raises(WeightsMismatch, match="is of NanoTrack v2; pass variant=v2"):
        find_pair(fill(tmp_path, *ALL[2:4]), "v1")


def test_several_files_for_one_part_are_named(tmp_path):
    folder = fill(tmp_path, *OFFICIAL, "nanotrack_head.onnx")
    with pytest.raises(WeightsMismatch, match=r"nanotrack_head\.onnx, nanotrack_head_sim\.onnx"):
        find_pair(folder, "v2")


def test_of_a_given_folder_nothing_but_its_name_is_taken(tmp_path, monkeypatch):
    """It may be a home folder: reading all of it for a digest would take for ever."""
    fill(tmp_path, *OFFICIAL).joinpath("gone").symlink_to(tmp_path / "nowhere")
    monkeypatch.setattr("nat2024.zoo.weights.sha256_of", pytest.fail)
    found, folder = find_folder("opencv_nano", tmp_path, OpenCVNano.card, "both ONNX files")
    assert (found.path, found.origin, found.sha256) == (tmp_path, "given", "")
    assert folder == tmp_path
