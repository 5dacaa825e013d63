"""Converting real folders: what lies where, foreign files, names and links that must not escape."""

import json
import os
import shutil
from pathlib import Path

import cv2
import msgspec
import numpy as np
import pytest

from nat2024.datasets import load_dataset, validate
from nat2024.datasets.conversion import FORMATS, convert
from nat2024.datasets.index import index_dataset, write_index
from nat2024.datasets.schema import AttributeTerm, encode_dataset
from nat2024.datasets.schema_checks import read_dataset
from nat2024.errors import AnnotationInvalid, DatasetIncomplete, DatasetNotFound, UsageError

ROWS = [(1, 2, 3, 4), (0.5, -1, 0, 0), [np.nan] * 4]


def truth(dataset):
    """Lengths and boxes to the last bit, by name."""
    return {s.name: (len(s), s.boxes.tobytes()) for s in dataset}


@pytest.fixture
def night(make, tmp_path):
    folder = make.apart(tmp_path / "night", {"car_1": 3, "bike_2": 2})
    make.rows(folder / "anno" / "car_1.txt", ROWS)
    for number in (1, 2, 3):
        data = make.encoded(seed=number)
        (folder / "data_seq" / "car_1" / f"{number:05d}.jpg").write_bytes(data)
    return folder


@pytest.mark.parametrize("name", FORMATS)
@pytest.mark.parametrize("frames", ["copy", "link"])
def test_each_format_loads_as_the_source_does(night, tmp_path, name, frames):
    before = load_dataset(night)
    done = convert(night, tmp_path / "out", name, frames=frames)
    assert (done.sequences, done.frames) == (2, 5)
    assert (done.copied, done.linked) == ((5, 0) if frames == "copy" else (0, 5))
    after = load_dataset(tmp_path / "out")
    assert truth(after) == truth(before)
    for sequence in before:
        same = after[sequence.name]
        assert same.category == sequence.category
        for index in range(len(sequence)):
            assert np.array_equal(same.image(index), sequence.image(index))
    assert validate(tmp_path / "out").ok
    convert(tmp_path / "out", tmp_path / "back", "index")
    assert (tmp_path / "back" / "nat-bench.json").read_bytes() == encode_dataset(
        index_dataset(night)
    )


@pytest.mark.parametrize("name", ["got10k", "published"])
def test_other_programs_read_what_is_written(night, tmp_path, name):
    """Without our side file the folder is one of the ordinary layouts."""
    convert(night, tmp_path / "out", name)
    (tmp_path / "out" / "nat-bench-extra.json").unlink()
    assert truth(load_dataset(tmp_path / "out")) == truth(load_dataset(night))


def test_got10k_files(night, tmp_path):
    convert(night, tmp_path / "out", "got10k")
    folder = tmp_path / "out" / "car_1"
    assert (tmp_path / "out" / "list.txt").read_text() == "bike_2\ncar_1\n"
    assert sorted(os.listdir(folder)) == [  # noqa: PTH208
        *("00000001.jpg", "00000002.jpg", "00000003.jpg"),
        *("cut_by_image.label", "groundtruth.txt", "meta_info.ini"),
    ]
    assert np.array_equal(
        np.loadtxt(folder / "groundtruth.txt", delimiter=","), np.array(ROWS), equal_nan=True
    )
    assert (folder / "cut_by_image.label").read_text().split() == ["0", "1", "0"]
    assert "object_class: car\n" in (folder / "meta_info.ini").read_text()
    assert "resolution: (16, 12)\n" in (folder / "meta_info.ini").read_text()


def test_a_folder_of_got10k_keeps_its_labels(make, tmp_path):
    source = tmp_path / "got"
    make.frames(source / "GOT_1", 3, digits=8)
    make.rows(source / "GOT_1" / "groundtruth.txt", 3)
    (source / "GOT_1" / "absence.label").write_text("0\n0\n1\n")
    (source / "GOT_1" / "cover.label").write_text("8\n3\n0\n")
    (source / "GOT_1" / "cut_by_image.label").write_text("0\n1\n0\n")
    (source / "GOT_1" / "meta_info.ini").write_text(
        "[METAINFO]\nurl: https://x.y/z\nbegin: 00:01\nanno_fps: 10Hz\n"
        "object_class: brown bear\nmotion_class: walking\nresolution: (1920, 1080)\n"
    )
    (loaded,) = load_dataset(source)
    assert (loaded.category, loaded.activity) == ("brown bear", "walking")
    convert(source, tmp_path / "index", "index")
    (record,) = read_dataset(tmp_path / "index" / "nat-bench.json").sequences
    assert (record.absent, record.cover, record.cut_by_image) == ((0, 0, 1), (8, 3, 0), (0, 1, 0))
    assert record.visible == (1, 1, 0)
    assert (record.fps, record.resolution) == (10.0, (1920, 1080))
    assert record.extra == {"got10k.url": "https://x.y/z", "got10k.begin": "00:01"}
    convert(tmp_path / "index", tmp_path / "again", "got10k")
    for name in ("absence.label", "cover.label", "cut_by_image.label", "groundtruth.txt"):
        text = (source / "GOT_1" / name).read_text()
        assert (tmp_path / "again" / "GOT_1" / name).read_text() == text
    meta = (tmp_path / "again" / "GOT_1" / "meta_info.ini").read_text()
    assert "anno_fps: 10Hz\nobject_class: brown bear\nmotion_class: walking" in meta


@pytest.fixture
def pysot_file(make, tmp_path):
    """As OTB's file of the pysot toolkit, with NaN as Python writes it."""
    make.frames(tmp_path / "OTB" / "Car" / "img", 3, digits=4)
    video = {
        "video_dir": "Car",
        "init_rect": [1, 2, 3, 4],
        "img_names": [f"Car/img/{i:04d}.jpg" for i in (1, 2, 3)],
        "gt_rect": [[1, 2, 3, 4], [0.1, 0.2, 30, 40], [float("nan")] * 4],
        "attr": ["IV", "FM"],
        "absent": [1, 1, 0],
        "camera_motion": [0, 1, 0],
    }
    path = tmp_path / "OTB" / "OTB1.json"
    path.write_text(json.dumps({"Car": video}))
    return path


def test_pysot_json_of_another_program(pysot_file, tmp_path):
    for place in (pysot_file, pysot_file.parent):
        (car,) = load_dataset(place)
        assert car.boxes[1].tolist() == [0.1, 0.2, 30, 40]
        assert np.isnan(car.boxes[2]).all()
        assert car.attributes == {"FM", "IV"}
        assert car.visible.tolist() == [True, True, False]
        assert car.image(2).shape == (12, 16, 3)
    assert load_dataset(pysot_file).name == "OTB1"
    convert(pysot_file, tmp_path / "index", "index")
    convert(tmp_path / "index", tmp_path / "again", "pysot")
    again = json.loads((tmp_path / "again" / "OTB1.json").read_text())["Car"]
    before = json.loads(pysot_file.read_text())["Car"]
    for key in ("init_rect", "absent", "camera_motion"):
        assert again[key] == before[key]
    assert sorted(again["attr"]) == sorted(before["attr"])
    assert np.array_equal(again["gt_rect"], before["gt_rect"], equal_nan=True)


def test_box_files_go_before_json_of_another_program(pysot_file, make):
    make.rows(pysot_file.parent / "Car" / "groundtruth_rect.txt", 3)
    assert load_dataset(pysot_file.parent)["Car"].boxes.tolist() == [[1, 2, 3, 4]] * 3


@pytest.mark.parametrize(
    ("key", "value", "words"),
    [
        ("img_names", ["../x.jpg"] * 3, "lead out of the dataset's folder"),
        ("img_names", ["Car/img/1.jpg", "Car/2.jpg", "3.jpg"], "3 folders"),
        ("gt_rect", [[1, 2, 3]] * 3, "gt_rect: expected rows of 4 numbers"),
        ("gt_rect", [[1, 2, 3, 4]], "1 boxes, but 3 frames"),
        ("gt_rect", [["a", 2, 3, 4]] * 3, "no pysot JSON"),
        ("absent", [1, 5, 1], "absent: expected 0 and 1"),
        ("img_names", [], "folders, expected one"),
    ],
)
def test_broken_pysot_json(pysot_file, key, value, words):
    plain = json.loads(pysot_file.read_text())
    plain["Car"][key] = value
    pysot_file.write_text(json.dumps(plain))
    with pytest.raises(AnnotationInvalid, match=words):
        load_dataset(pysot_file)


@pytest.fixture
def coco_file(make, tmp_path):
    """Two tracks in one video, frames below `data`, as tools for video detection have it."""
    make.frames(tmp_path / "coco" / "data" / "clip", 3, digits=6)
    plain = {
        "videos": [{"id": 7, "name": "clip", "width": 16, "height": 12, "fps": 25}],
        "images": [
            {"id": 10 + i, "video_id": 7, "frame_id": i, "file_name": f"clip/{i + 1:06d}.jpg"}
            for i in (2, 0, 1)
        ],
        "annotations": [
            {"id": 1, "image_id": 10, "track_id": 1, "category_id": 3, "bbox": [1, 2, 3, 4]},
            {"id": 2, "image_id": 12, "track_id": 1, "category_id": 3, "bbox": [2, 2, 3, 4.5]},
            {"id": 3, "image_id": 11, "track_id": 2, "category_id": 4, "bbox": [5, 6, 7, 8]},
        ],
        "categories": [{"id": 3, "name": "car"}, {"id": 4, "name": "person"}],
    }
    path = tmp_path / "coco" / "annotations" / "val.json"
    path.parent.mkdir()
    path.write_text(json.dumps(plain))
    return path


def test_coco_video_of_another_program(coco_file, tmp_path):
    for place in (coco_file, coco_file.parents[1]):
        car, person = load_dataset(place)
        assert (car.name, person.name) == ("clip_1", "clip_2")
        assert (car.category, person.category) == ("car", "person")
        assert car.boxes[2].tolist() == [2, 2, 3, 4.5]
        assert np.isnan(car.boxes[1]).all()
        assert person.image(1).shape == (12, 16, 3)
    done = convert(coco_file, tmp_path / "index", "index")
    assert "not kept" in done.remarks[0]
    document = read_dataset(tmp_path / "index" / "nat-bench.json")
    assert {s.fps for s in document.sequences} == {25.0}
    assert done.copied == 3  # both targets share the frames
    convert(tmp_path / "index", tmp_path / "again", "coco-video")
    again = json.loads((tmp_path / "again" / "annotations.json").read_text())
    assert sorted(a["bbox"] for a in again["annotations"]) == [
        [1, 2, 3, 4],
        [2, 2, 3, 4.5],
        [5, 6, 7, 8],
    ]
    assert [c["name"] for c in again["categories"]] == ["car", "person"]


def test_broken_coco_video(coco_file):
    plain = json.loads(coco_file.read_text())
    plain["images"][0]["file_name"] = "../../secret.jpg"
    coco_file.write_text(json.dumps(plain))
    with pytest.raises(AnnotationInvalid, match=r"'../../secret.jpg' leads out"):
        load_dataset(coco_file)
    plain["images"][0]["file_name"] = "clip/000003.jpg"
    plain["annotations"].append(plain["annotations"][0])
    coco_file.write_text(json.dumps(plain))
    with pytest.raises(AnnotationInvalid, match="two boxes of track 1"):
        load_dataset(coco_file)


def test_json_that_is_no_annotation(tmp_path, make):
    make.frames(tmp_path / "d" / "car", 2)
    (tmp_path / "d" / "settings.json").write_text('{"a": 1}')
    assert len(load_dataset(tmp_path / "d", unannotated=True)) == 1
    with pytest.raises(AnnotationInvalid, match=r"settings.json: names no schema"):
        load_dataset(tmp_path / "d" / "settings.json")


def test_the_format_of_the_source_can_be_named(night, pysot_file, make, tmp_path):
    make.rows(pysot_file.parent / "Car" / "groundtruth_rect.txt", 3)
    convert(pysot_file.parent, tmp_path / "a", "index", source_format="pysot")
    assert read_dataset(tmp_path / "a" / "nat-bench.json").sequences[0].boxes[1][0] == 0.1
    convert(night, tmp_path / "b", "index", source_format="published")
    with pytest.raises(DatasetNotFound, match="no dataset of the format coco-video"):
        convert(night, tmp_path / "c", "index", source_format="coco-video")
    with pytest.raises(UsageError, match="closest: got10k"):
        convert(night, tmp_path / "c", "got-10k")


def test_annotation_alone(night, tmp_path):
    done = convert(night, tmp_path / "a", "pysot", frames="none")
    assert (done.copied, done.linked, done.annotation_files) == (0, 0, 2)
    with pytest.raises(DatasetIncomplete, match="3 of 3 frames are not in"):
        load_dataset(tmp_path / "a")
    with pytest.raises(DatasetIncomplete, match="frames are not in"):
        convert(tmp_path / "a", tmp_path / "b", "index")
    convert(tmp_path / "a", tmp_path / "c", "index", frames="none")


def test_frames_whose_names_sort_otherwise_as_text_are_renumbered(make, tmp_path):
    make.frames(tmp_path / "x" / "car", 11, digits=1)
    make.rows(tmp_path / "x" / "car" / "groundtruth.txt", 11)
    convert(tmp_path / "x", tmp_path / "out", "pysot")
    names = json.loads((tmp_path / "out" / "x.json").read_text())["car"]["img_names"]
    assert names == sorted(names)
    assert names[10] == "car/00000011.jpg"


def test_links_in_the_source_become_files(night, tmp_path):
    frame = night / "data_seq" / "car_1" / "00001.jpg"
    frame.unlink()
    frame.symlink_to(frame.with_name("00002.jpg"))
    convert(night, tmp_path / "out", "published", frames="link")
    copied = tmp_path / "out" / "data_seq" / "car_1" / "00001.jpg"
    assert not copied.is_symlink()
    assert copied.read_bytes() == frame.read_bytes()


def test_the_output_folder_must_be_empty(night, tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "x").write_text("")
    with pytest.raises(UsageError, match="not an empty folder"):
        convert(night, tmp_path / "out", "got10k")
    (tmp_path / "link").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(UsageError, match="not an empty folder"):
        convert(night, tmp_path / "link", "got10k")


@pytest.mark.parametrize(
    ("name", "to"),
    [
        ("list.txt", "got10k"),
        ("nat-bench-extra.json", "pysot"),
        ("annotations.json", "coco-video"),
        ("odd.json", "pysot"),
    ],
)
def test_sequences_called_like_a_file_of_the_format(make, tmp_path, name, to):
    make.frames(tmp_path / "odd" / name, 1)
    make.rows(tmp_path / "odd" / name / "groundtruth.txt", 1)
    with pytest.raises(AnnotationInvalid, match="rename a sequence"):
        convert(tmp_path / "odd", tmp_path / "out", to)
    assert not (tmp_path / "out").exists()


def test_a_changed_box_file_wins_over_the_side_file(night, make, tmp_path):
    convert(night, tmp_path / "out", "got10k")
    make.rows(tmp_path / "out" / "car_1" / "groundtruth.txt", [(9, 9, 9, 9)] * 3)
    assert load_dataset(tmp_path / "out")["car_1"].boxes[0].tolist() == [9, 9, 9, 9]
    make.rows(tmp_path / "out" / "car_1" / "groundtruth.txt", 2)
    with pytest.raises(AnnotationInvalid, match="2 boxes, but 3 frames"):
        load_dataset(tmp_path / "out")


@pytest.mark.parametrize("name", FORMATS)
def test_a_converted_dataset_in_an_archive(night, tmp_path, name):
    source = tmp_path / "source"
    convert(night, source, "index")
    convert(source, tmp_path / "out", name)
    archive = Path(shutil.make_archive(str(tmp_path / "whole"), "zip", tmp_path / "out"))
    dataset = load_dataset(archive)
    assert truth(dataset) == truth(load_dataset(night))
    assert dataset["car_1"].image(2).shape == (12, 16, 3)
    assert validate(archive).ok
    convert(archive, tmp_path / "back", "index")
    whole = (tmp_path / "back" / "nat-bench.json").read_bytes()
    assert whole == (source / "nat-bench.json").read_bytes()


def test_attribute_files_whose_columns_nobody_names_are_kept(night, tmp_path):
    for name in ("car_1", "bike_2"):
        (night / "att").mkdir(exist_ok=True)
        (night / "att" / f"{name}.txt").write_text("0,1,0\n")
    convert(night, tmp_path / "got", "got10k")
    convert(tmp_path / "got", tmp_path / "back", "published")
    assert (tmp_path / "back" / "att" / "car_1.txt").read_text() == "0,1,0\n"


@pytest.fixture
def videos(make, tmp_path):
    """One sequence as a video of four frames."""
    folder = tmp_path / "videos"
    make.rows(folder / "anno" / "car.txt", 4)
    (folder / "data_seq").mkdir()
    code = cv2.VideoWriter_fourcc(*"MJPG")
    path = str(folder / "data_seq" / "car.avi")
    writer = cv2.VideoWriter(path, cv2.CAP_FFMPEG, code, 25, (48, 32))
    for seed in range(4):
        writer.write(make.image(seed, (48, 32)))
    writer.release()
    return folder


def test_a_video_stays_a_video(videos, tmp_path):
    for name in ("index", "published"):
        done = convert(videos, tmp_path / name, name)
        assert (done.frames, done.copied) == (4, 1)
        (car,) = load_dataset(tmp_path / name)
        (before,) = load_dataset(videos)
        assert np.array_equal(car.image(3), before.image(3))
        assert validate(tmp_path / name).ok
        assert convert(tmp_path / name, tmp_path / f"{name}_again", "index").frames == 4
    index = tmp_path / "published_again" / "nat-bench.json"
    assert read_dataset(index).sequences[0].frames.video == "car.avi"
    with pytest.raises(UsageError, match="car is a video, but got10k holds folders of images"):
        convert(videos, tmp_path / "got", "got10k")


def test_an_altered_video_is_found(videos, tmp_path):
    convert(videos, tmp_path / "out", "index")
    path = tmp_path / "out" / "data_seq" / "car.avi"
    path.write_bytes(path.read_bytes() + b"\0")
    (problem,) = validate(tmp_path / "out").problems
    assert problem.message == "car: car.avi altered, by size or checksum"


def test_what_other_programs_find_in_each_format(night, tmp_path):
    document = index_dataset(night)
    bike, car = document.sequences
    car = msgspec.structs.replace(car, visible=(1, 1, 0), attributes={"FM": "manual"}, fps=25.0)
    terms = (AttributeTerm(name="IV"), AttributeTerm(name="FM"))
    changed = msgspec.structs.replace(document, attributes=terms, sequences=(bike, car))
    write_index(changed, night / "nat-bench.json")
    out = {name: tmp_path / name for name in FORMATS}
    for name, folder in out.items():
        convert(night, folder, name)
    assert (out["published"] / "att" / "car_1.txt").read_text() == "0,1\n"
    assert (out["got10k"] / "car_1" / "absence.label").read_text() == "0\n0\n1\n"
    assert (out["got10k"] / "car_1" / "cover.label").read_text() == "8\n8\n0\n"
    assert not (out["got10k"] / "bike_2" / "cover.label").exists()
    pysot = json.loads((out["pysot"] / "night.json").read_text())
    assert list(pysot) == ["bike_2", "car_1"]
    assert pysot["car_1"]["absent"] == [1, 1, 0]  # the toolkit scores the frames whose flag is 1
    assert pysot["car_1"]["attr"] == ["FM"]
    assert pysot["car_1"]["init_rect"] == [1, 2, 3, 4]
    assert "absent" not in pysot["bike_2"]
    coco = json.loads((out["coco-video"] / "annotations.json").read_text())
    assert coco["videos"][1] == {"id": 2, "name": "car_1", "width": 16, "height": 12, "fps": 25.0}
    assert [c["name"] for c in coco["categories"]] == ["bike", "car"]
    assert len(coco["images"]) == 5
    assert coco["images"][2]["file_name"] == "car_1/00001.jpg"
    assert [a["image_id"] for a in coco["annotations"]] == [1, 2, 3, 4]  # none of the absent frame
    assert coco["annotations"][3]["bbox"] == [0.5, -1, 0, 0]
    assert all(a["id"] == i for i, a in enumerate(coco["annotations"], 1))
