"""`nat-bench show` as a user meets it, on boxes beside the truth of three rendered sequences."""

import json
import shutil
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

import nat2024
from nat2024.boxes import write_boxes
from nat2024.store import DatasetRecord, Manifest, PluginRecord, RunFolder


@pytest.fixture(scope="module")
def results(night_clip: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """`mosse` drifts away, `mosse+gamma` stays; `kcf` has NaN, far and flat boxes."""
    folder = tmp_path_factory.mktemp("shown") / "results"
    made = DatasetRecord("night_clip", str(night_clip))
    gamma = PluginRecord("gamma", options={"gamma": 0.5})
    for name, speed in (("mosse", 6.0), ("mosse+gamma", 0.5), ("kcf", 3.0)):
        run = RunFolder(folder / "night_clip" / name)
        enhancer = gamma if "+" in name else None
        tracker = PluginRecord(name.partition("+")[0])
        run.write_manifest(Manifest(dataset=made, tracker=tracker, enhancer=enhancer))
        for sequence in nat2024.load_dataset(str(night_clip)):
            boxes = sequence.boxes.copy()
            boxes[:, 0] += speed * np.arange(len(boxes))
            if name == "kcf":
                boxes[2] = np.nan
                boxes[3] = [1e9, -1e9, 5, 5]
                boxes[4, 2:] = 0
            write_boxes(run.box_file(sequence.name), boxes)
    return folder


@pytest.fixture
def show(cli: Any, results: Path, tmp_path: Path) -> Any:
    def call(*words: object, results: Path = results) -> tuple[int, str, str]:
        return cli("show", "--results", results, "--out", tmp_path / "out", *words)

    return call


def test_a_strip_shows_telling_frames_with_their_reasons(show: Any) -> None:
    status, out, err = show("--sequence", "narrow", "--count", 4, "--format", "png", "--json")
    assert status == 0, err
    (about,) = json.loads(out)["files"]
    assert about["form"] == "strip"
    assert about["sequence"] == "narrow"
    assert set(about["runs"]) == {"kcf", "mosse", "mosse+gamma"}
    assert len(about["frames"]) == 4
    assert about["frames"] == sorted(set(about["frames"]))
    assert any("largest gain" in why for why in about["why"])
    assert cv2.imread(about["path"]).shape[1] == 1432


def test_frames_are_chosen_by_hand_too(show: Any) -> None:
    words = ("--sequence", "tall", "--frame", "6,1", "--original", "--whole", "--format", "svg")
    status, out, _ = show(*words, "--run", "mosse", "--json")
    (about,) = json.loads(out)["files"]
    assert status == 0
    assert (about["frames"], about["runs"]) == ([1, 6], ["mosse"])
    again = Path(about["path"]).read_bytes()
    show(*words, "--run", "mosse")
    assert Path(about["path"]).read_bytes() == again  # equal data, equal bytes


def test_where_no_sequence_is_named_the_most_telling_are_shown_and_said(show: Any) -> None:
    status, out, err = show("--format", "png", "--count", 1, "--original", "--json")
    shown = {about["sequence"] for about in json.loads(out)["files"]}
    assert status == 0
    assert shown == {"narrow", "tall", "wide"}
    assert "which tell most; --sequence names others" in err


def test_a_video_has_every_frame_and_enhanced_ones_beside(show: Any) -> None:
    words = ("--sequence", "wide", "--as", "video", "--enhancers", "gamma", "--trackers", "mosse")
    status, out, _ = show(*words, "--enhanced", "--json")
    (about,) = json.loads(out)["files"]
    assert (status, about["format"], about["frames"]) == (0, "webm", list(range(8)))
    capture = cv2.VideoCapture(about["path"])
    frames = [capture.read()[1] for _ in range(8)]
    assert frames[-1].shape[:2][1] == 320  # two panels of 160
    original, enhanced = frames[3][:96, :160], frames[3][:96, 160:]
    assert enhanced.mean() > original.mean() + 5
    assert not capture.read()[0]


def test_mp4_needs_its_extra_and_single_frames_need_none(
    show: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("imageio_ffmpeg")
    words = ("--sequence", "wide", "--as", "video", "--video-format", "mp4", "--range", "2:5")
    status, out, _ = show(*words, "--json")
    (about,) = json.loads(out)["files"]
    assert (status, about["frames"]) == (0, [2, 3, 4, 5])
    assert int(cv2.VideoCapture(about["path"]).get(cv2.CAP_PROP_FRAME_COUNT)) == 4
    monkeypatch.setitem(__import__("sys").modules, "imageio_ffmpeg", None)
    status, _, err = show(*words)
    assert status == 2
    assert 'pip install "nat-bench[video]"' in err
    status, out, _ = show("--sequence", "wide", "--as", "frames", "--range", "7:", "--json")
    (about,) = json.loads(out)["files"]
    assert status == 0
    assert Path(about["path"]).name == "00007.png"
    assert not list(tmp_path.rglob(".*part*"))


def test_wrong_names_and_options_are_said_in_one_line(show: Any, tmp_path: Path) -> None:
    for words, text in (
        (("--sequence", "narow"), "closest: narrow"),
        (("--run", "mosse+gama"), "closest: mosse+gamma"),
        (("--trackers", "mose"), "closest: mosse"),
        (("--sequence", "wide", "--frame", "8"), "wide has frames 0 to 7"),
        (("--frame", "one"), "expected numbers of frames"),
        (("--range", "5"), "expected FIRST:LAST"),
        (("--sequence", "wide", "--as", "video", "--range", "9:12"), "frames 0 to 7"),
        (("--format", "gif"), "expected some of pdf, svg, png"),
        (("--count", "0"), "--count takes at least 1"),
    ):
        status, _, err = show(*words)
        assert status == 2, words
        assert text in err.splitlines()[-1], words
    status, _, err = show(results=tmp_path)
    assert status == 2
    assert "holds no results" in err


def test_a_sequence_without_images_is_named_and_the_rest_is_made(
    cli: Any, results: Path, night_clip: Path, tmp_path: Path
) -> None:
    data = tmp_path / "night_clip"
    shutil.copytree(night_clip, data)
    for image in (data / "data_seq" / "narrow").iterdir():
        image.write_bytes(b"no image")
    words = ("show", "--results", results, "--dataset", data, "--out", tmp_path / "out")
    forms = ("--as", "strip", "--as", "video", "--original", "--format", "png", "--json")
    status, out, _ = cli(*words, *forms, "--sequence", "narrow,tall", "--range", "0:1")
    found = json.loads(out)
    assert status == 0
    assert {about["sequence"] for about in found["files"]} == {"tall"}
    assert "night_clip, narrow: no frame can be read, no strip is made" in found["remarks"]
    assert "night_clip, narrow: no frame can be read, no video is made" in found["remarks"]
    status, _, err = cli(*words, "--sequence", "narrow")
    assert status == 2
    assert "nothing to show" in err


def test_one_bad_frame_leaves_a_gap(
    cli: Any, results: Path, night_clip: Path, tmp_path: Path
) -> None:
    data = tmp_path / "night_clip"
    shutil.copytree(night_clip, data)
    sorted((data / "data_seq" / "narrow").iterdir())[0].write_bytes(b"no image")
    words = ("show", "--results", results, "--dataset", data, "--out", tmp_path / "out")
    forms = ("--as", "strip", "--as", "frames", "--original", "--format", "png", "--json")
    status, out, _ = cli(*words, *forms, "--sequence", "narrow", "--frame", "0,3", "--range", "0:1")
    found = json.loads(out)
    assert status == 0
    assert [about["form"] for about in found["files"]] == ["strip", "frames", "frames"]
    assert any("(frame 0, counted from 0)" in remark for remark in found["remarks"])
