"""The adapters whose networks or classes are not at hand: what can be held without them."""

import math

import cv2
import numpy as np
import pytest

import nat2024
from nat2024.errors import InvalidOption, NatBenchError, WeightsMismatch, WeightsMissing
from nat2024_trackers.opencv.base import OpenCVFailure

DASIAMRPN = ("dasiamrpn_model.onnx", "dasiamrpn_kernel_cls1.onnx", "dasiamrpn_kernel_r1.onnx")
CONTRIB = {"opencv_csrt": "TrackerCSRT", "opencv_kcf": "TrackerKCF"}


class Scripted:
    """Stands for a `cv2.Tracker`: moves by a pixel a frame, loses the target where told to."""

    losing = ()

    def __init__(self):
        self.frame = 0

    @classmethod
    def create(cls, parameters=None):
        tracker = cls()
        tracker.parameters = parameters
        return tracker

    def init(self, image, box):
        assert image.flags.c_contiguous
        assert all(isinstance(value, int) for value in box)
        self.box = box

    def update(self, image):
        del image
        self.frame += 1
        x, y, w, h = self.box
        found = self.frame not in self.losing
        return found, (x + self.frame, y, w, h) if found else (0, 0, 0, 0)

    def getTrackingScore(self):  # noqa: N802 - OpenCV's name
        return math.nan if self.frame in self.losing else 0.75


@pytest.fixture
def scripted(monkeypatch):
    """Puts a scripted tracker in OpenCV's place; gives its class."""

    def put(name, *, losing=()):
        found = type(name, (Scripted,), {"losing": losing})
        original = getattr(cv2, name, None)
        if original is not None:
            found.Params = original.Params
        monkeypatch.setattr(cv2, name, found, raising=False)
        return found

    return put


@pytest.mark.parametrize(
    ("name", "options", "error", "words"),
    [
        ("opencv_vit", {}, WeightsMissing, "object_tracking_vittrack_2023sep.onnx from .*zoo"),
        ("opencv_vit", {"weights": False}, InvalidOption, "has no fresh weights"),
        ("opencv_vit", {"scope": "patch"}, InvalidOption, "only scope=frame"),
        ("opencv_dasiamrpn", {}, WeightsMissing, "dasiamrpn_kernel_r1.onnx, all in one folder"),
        ("opencv_dasiamrpn", {"weights": False}, InvalidOption, "has no fresh weights"),
    ],
)
def test_wrong_use_is_told_in_one_line(name, options, error, words):
    with pytest.raises(error, match=words) as caught:
        nat2024.create_tracker(name, **options)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["opencv_vit", "opencv_dasiamrpn"])
def test_broken_files_are_told_at_creation_without_noise(name, tmp_path, capfd):
    for file in (*DASIAMRPN, "object_tracking_vittrack_2023sep.onnx"):
        (tmp_path / file).write_bytes(b"no network")
    weights = tmp_path if name == "opencv_dasiamrpn" else tmp_path / file
    with pytest.raises(WeightsMismatch, match="networks that OpenCV can run") as caught:
        nat2024.create_tracker(name, weights=weights)
    assert "\n" not in str(caught.value)
    assert "WARN" not in capfd.readouterr().err


def test_vit_takes_a_file_and_no_folder(tmp_path):
    with pytest.raises(WeightsMissing, match="pass the ONNX file itself"):
        nat2024.create_tracker("opencv_vit", weights=tmp_path)


def test_missing_files_of_three_are_named(tmp_path):
    (tmp_path / DASIAMRPN[0]).write_bytes(b"")
    with pytest.raises(WeightsMissing, match=r"no .*cls1\.onnx and no .*r1\.onnx in it"):
        nat2024.create_tracker("opencv_dasiamrpn", weights=tmp_path)
    with pytest.raises(WeightsMissing, match="pass the folder"):
        nat2024.create_tracker("opencv_dasiamrpn", weights=tmp_path / DASIAMRPN[0])


def test_vit_keeps_the_last_box_below_the_threshold(tmp_path, clip, scripted, gamma):
    scripted("TrackerVit", losing=(2,))
    path = tmp_path / "vit.onnx"
    path.write_bytes(b"any")
    enhancer = gamma()
    tracker = nat2024.create_tracker("opencv_vit", weights=path, enhancer=enhancer)
    frames, box = clip
    np.testing.assert_array_equal(tracker.init(frames[0], box + 0.25), box + 0.25)
    assert tracker._tracker.parameters.net == str(path)
    rows = [tracker.update(frame) for frame in frames[1:4]]
    np.testing.assert_array_equal([row[0] for row, _ in rows], box[0] + np.array([1, 1, 3]))
    assert [score for _, score in rows] == [0.75, 0.0, 0.75]
    assert [tuple(batch.shape) for batch in enhancer.batches] == [(1, 3, 180, 240)] * 4


def test_dasiamrpn_gets_its_three_files(tmp_path, clip, scripted):
    scripted("TrackerDaSiamRPN")
    for file in (*DASIAMRPN, "notes.txt"):
        (tmp_path / file).write_bytes(file.encode())
    tracker = nat2024.create_tracker("opencv_dasiamrpn", weights=tmp_path)
    assert [path.name for path in tracker.weights.files] == list(DASIAMRPN)
    frames, box = clip
    tracker.init(frames[0], box)
    given = tracker._tracker.parameters
    assert [given.model, given.kernel_cls1, given.kernel_r1] == [
        str(tmp_path / file) for file in DASIAMRPN
    ]
    row, score = tracker.update(frames[1])
    assert (row[0], score) == (box[0] + 1, 0.75)


@pytest.mark.parametrize("name", CONTRIB)
def test_without_the_contrib_build_one_line_says_what_is_missing(name, monkeypatch):
    monkeypatch.delattr(cv2, CONTRIB[name], raising=False)
    monkeypatch.delattr(cv2, "legacy", raising=False)
    with pytest.raises(OpenCVFailure, match=r"has no Tracker.*opencv-contrib-python-") as e:
        nat2024.create_tracker(name)
    assert "\n" not in str(e.value)


@pytest.mark.parametrize("name", CONTRIB)
def test_with_the_contrib_build_they_track(name, clip, scripted):
    scripted(CONTRIB[name], losing=(1,))
    frames, box = clip
    tracker = nat2024.create_tracker(name)
    tracker.init(frames[0], box + 0.25)
    row, score = tracker.update(frames[1])
    np.testing.assert_array_equal(row, box + 0.25)  # lost: the last box stays
    assert math.isnan(score)
    np.testing.assert_array_equal(tracker.update(frames[2])[0], box + [2, 0, 0, 0])


def test_a_class_that_only_legacy_has_is_found(monkeypatch):
    class Legacy:
        TrackerCSRT = Scripted

    monkeypatch.delattr(cv2, "TrackerCSRT", raising=False)
    monkeypatch.setattr(cv2, "legacy", Legacy, raising=False)
    assert isinstance(nat2024.create_tracker("opencv_csrt").make(), Scripted)


@pytest.mark.parametrize("name", ["opencv_vit", "opencv_dasiamrpn", *CONTRIB])
def test_what_could_not_be_run_says_so_and_tells_no_number(name):
    card = nat2024.registry.load_plugin(name, "tracker").card
    assert card.state.startswith("untested")
    assert (card.parameters, card.macs, card.published) == (0, 0, ())
    assert card.scopes == ("frame",)


@pytest.mark.parametrize("name", CONTRIB)
def test_a_run_with_one_that_is_not_there_ends_with_one_line(name, monkeypatch):
    from nat2024.engine import Combination, PluginSpec

    monkeypatch.delattr(cv2, CONTRIB[name], raising=False)
    monkeypatch.delattr(cv2, "legacy", raising=False)
    with pytest.raises(NatBenchError, match="opencv-contrib"):
        Combination(PluginSpec.parse(name), None).create()


def test_the_manifest_of_mil_says_that_it_is_not_repeatable():
    from nat2024.engine.plan import PluginSpec, plugin_record

    record = plugin_record(PluginSpec.parse("mil"), nat2024.create_tracker("mil"))
    assert record.repeatable is False
    record = plugin_record(PluginSpec.parse("fdsst"), nat2024.create_tracker("fdsst"))
    assert record.repeatable is True
