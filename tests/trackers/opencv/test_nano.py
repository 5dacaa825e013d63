import shutil

import cv2
import numpy as np
import pytest

import nat2024
from nat2024.errors import InvalidOption, WeightsMismatch, WeightsMissing
from nat2024.zoo import sha256_of

THRESHOLDS = np.arange(21) * 0.05


@pytest.fixture
def kit(shared):
    return shared / "parity" / "trackers" / "nanotrack"


def create(**options):
    return nat2024.create_tracker("opencv_nano", **options)


@pytest.mark.parametrize(
    ("options", "error", "words"),
    [
        ({}, WeightsMissing, "nanotrackv1/.*both in one folder from .*SiamTrackers"),
        ({"variant": "v2"}, WeightsMissing, "nanotrackv2/.*both in one folder"),
        ({"weights": False}, InvalidOption, "has no fresh weights"),
        ({"variant": "v3"}, InvalidOption, "expects a 16x16 map.*it has v1, v2"),
        ({"weights": "no/such/folder"}, WeightsMissing, "no/such/folder: no such file"),
        ({"weights": False, "scope": "patch"}, InvalidOption, "only scope=frame"),
    ],
)
def test_wrong_use_is_told_in_one_line(options, error, words):
    with pytest.raises(error, match=words) as caught:
        create(**options)
    assert "\n" not in str(caught.value)


def test_a_file_is_not_the_folder(tmp_path):
    (tmp_path / "nanotrack_backbone_sim.onnx").write_bytes(b"")
    with pytest.raises(WeightsMissing, match="pass the folder"):
        create(weights=tmp_path / "nanotrack_backbone_sim.onnx")


def test_broken_files_are_told_at_creation_without_noise(tmp_path, capfd):
    for part in ("backbone", "head"):
        (tmp_path / f"nanotrack_{part}_sim.onnx").write_bytes(b"no network")
    with pytest.raises(
        WeightsMismatch, match="no NanoTrack networks that OpenCV can run"
    ) as caught:
        create(weights=tmp_path)
    assert "\n" not in str(caught.value)
    assert "WARN" not in capfd.readouterr().err


@pytest.mark.shared
@pytest.mark.parametrize("variant", ["v1", "v2"])
def test_it_tracks_and_identifies_its_files(kit, clip, variant, capfd):
    frames, box = clip
    tracker = create(weights=kit, variant=variant)
    level = cv2.utils.logging.getLogLevel()
    np.testing.assert_array_equal(tracker.init(frames[0], box + 0.25), box + 0.25)
    row, score = tracker.update(frames[1])
    assert row.dtype == np.float64
    assert (row == np.rint(row)).all()
    assert 0 < score <= 1
    pair = [kit / f"nanotrack{variant}_{part}.onnx" for part in ("backbone", "head")]
    assert [tracker.files.backbone, tracker.files.head] == pair
    assert tracker.weights.sha256 == sha256_of(*pair)
    assert tracker.weights.known_as.count(f"nanotrack{variant}/") == 2
    assert cv2.utils.logging.getLogLevel() == level
    assert "Targets are not supported" not in capfd.readouterr().err


@pytest.mark.shared
def test_only_the_two_files_count_for_the_digest(kit, tmp_path):
    for part in ("backbone", "head"):
        shutil.copy(kit / f"nanotrackv2_{part}.onnx", tmp_path)
    before = create(weights=tmp_path, variant="v2").weights.sha256
    (tmp_path / "notes.txt").write_text("beside")
    assert create(weights=tmp_path, variant="v2").weights.sha256 == before
    assert create(weights=kit, variant="v2").weights.sha256 == before


@pytest.mark.shared
@pytest.mark.parametrize(
    ("version", "words"),
    [("v2", "of NanoTrack v2; pass variant=v2"), ("v3", "v3, which OpenCV's tracker cannot run")],
)
def test_official_names_of_another_version_are_recognised(kit, tmp_path, version, words):
    for part in ("backbone", "head"):
        target = tmp_path / f"nanotrack_{part}_sim.onnx"
        shutil.copy(kit / f"nanotrack{version}_{part}.onnx", target)
    with pytest.raises(WeightsMismatch, match=words):
        create(weights=tmp_path, variant="v1")


@pytest.mark.shared
def test_unknown_files_that_stop_opencv_are_told_at_creation(kit, tmp_path):
    for part in ("backbone", "head"):
        content = (kit / f"nanotrackv3_{part}.onnx").read_bytes()
        # An empty field of a number that ONNX does not know: another digest, the same network.
        (tmp_path / f"nanotrack_{part}.onnx").write_bytes(content + b"\xfa\x3f\x00")
    with pytest.raises(WeightsMismatch, match="15x15"):
        create(weights=tmp_path)


def success_auc(found, truth):
    """Mean over 21 thresholds of the share of frames whose overlap is above."""
    low = np.maximum(found[:, :2], truth[:, :2])
    high = np.minimum(found[:, :2] + found[:, 2:], truth[:, :2] + truth[:, 2:])
    shared_area = np.clip(high - low, 0, None).prod(axis=1)
    union = found[:, 2:].prod(axis=1) + truth[:, 2:].prod(axis=1) - shared_area
    return np.mean([(shared_area / union > threshold).mean() for threshold in THRESHOLDS])


@pytest.mark.shared
@pytest.mark.slow
@pytest.mark.parametrize(
    ("sequence", "expected"),
    [
        ("uavdt_S1301a", 0.750),
        ("dtb70_Surfing06", 0.508),
        ("dtb70_MountainBike6", 0.700),
        ("uav123_wakeboard7", 0.751),
    ],
)
def test_success_on_real_sequences(shared, kit, sequence, expected):
    data = shared / "realdata"
    truth = nat2024.read_boxes(data / "anno" / f"{sequence}.txt")
    tracker = create(weights=kit, variant="v2")
    rows = []
    for path in sorted((data / "data_seq" / sequence).glob("*.jpg")):
        image = cv2.imread(str(path))
        rows.append(tracker.update(image)[0] if rows else tracker.init(image, truth[0]))
    assert success_auc(np.stack(rows), truth) == pytest.approx(expected, abs=0.01)
