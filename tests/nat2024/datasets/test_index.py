"""Index files: written from any folder, loaded, compared with what lies there."""

import json
import os

import msgspec
import numpy as np
import pytest

from nat2024.datasets import describe, load_dataset, validate
from nat2024.datasets.index import index_dataset, write_index
from nat2024.datasets.schema import encode_dataset
from nat2024.datasets.schema_checks import read_dataset
from nat2024.errors import (
    AnnotationInvalid,
    DatasetIncomplete,
    NatBenchError,
    UsageError,
)


def truth(dataset):
    """Lengths and boxes to the last bit, by name."""
    return {s.name: (len(s), s.boxes.tobytes()) for s in dataset}


@pytest.fixture
def night(make, tmp_path):
    folder = make.apart(tmp_path / "night", {"car_1": 3, "bike_2": 2})
    make.rows(folder / "anno" / "car_1.txt", [(1, 2, 3, 4), (0.5, -1, 0, 0), [np.nan] * 4])
    return folder


@pytest.fixture
def indexed(night):
    write_index(index_dataset(night), night / "nat-bench.json")
    return night


def problems(folder):
    return [(p.kind, p.message) for p in validate(folder).problems]


def change(folder, edit):
    path = folder / "nat-bench.json"
    plain = json.loads(path.read_bytes())
    edit(plain)
    path.write_text(json.dumps(plain))


def test_a_folder_is_described(night):
    document = index_dataset(night)
    assert document.name == "night"
    bike, car = document.sequences
    assert car.boxes == ((1, 2, 3, 4), (0.5, -1, 0, 0), (None,) * 4)
    assert (car.category, bike.category, bike.activity) == ("car", "bike", "cycling")
    assert car.resolution == (16, 12)
    assert (car.frames.folder, car.frames.pattern, car.frames.count) == (
        "data_seq/car_1",
        "%05d.jpg",
        3,
    )
    size = (night / "data_seq" / "car_1" / "00001.jpg").stat().st_size
    assert car.frames.sizes == (size,) * 3
    assert len(set(car.frames.sha256)) == 1
    assert index_dataset(night, checksums=False).sequences[0].frames.sha256 == ()


def test_a_registered_dataset_brings_what_is_published(make, tmp_path):
    folder = make.published(tmp_path / "x", "uavdark70", ["bike1", "car10"])
    for name in ("bike1", "car10"):
        make.rows(folder / "att" / f"{name}.txt", [(0, 1, 1, 0, 0)])
    document = index_dataset(folder, checksums=False)
    assert document.title == "UAVDark70"
    assert "ADTrack" in document.citation
    assert document.attribute_names == ("VC", "FM", "LR", "OCC", "IV", "LAI")
    assert document.attributes[1].title == "fast motion"
    assert document.sequences[0].attributes["LR"] == "published"


def test_loading_takes_the_index(indexed):
    plain = load_dataset(indexed)
    for file in (indexed / "anno").iterdir():
        file.unlink()
    dataset = load_dataset(indexed)
    assert dataset.name == "night"
    assert truth(dataset) == truth(plain)
    assert dataset["car_1"].image(2).shape == (12, 16, 3)
    assert dataset["car_1"].category == "car"
    by_file = load_dataset(indexed / "nat-bench.json")
    assert (by_file.name, truth(by_file)) == ("night", truth(plain))
    assert describe(indexed).layout == "index nat-bench.json (nat-bench/1)"


def test_an_index_elsewhere_is_loaded_with_its_root(night, tmp_path):
    path = tmp_path / "elsewhere" / "mine.json"
    write_index(index_dataset(night), path)
    dataset = load_dataset(path, night)
    assert dataset.name == "mine"
    assert dataset["bike_2"].image(1).shape == (12, 16, 3)
    with pytest.raises(DatasetIncomplete, match="2 of 2 frames are not in"):
        load_dataset(path)


def test_words_flags_and_provenance_are_loaded(indexed):
    def edit(plain):
        plain["attributes"] = [{"name": "UL"}, {"name": "FM"}]
        car = plain["sequences"][1]
        car["attributes"] = {"FM": "manual", "UL": "computed"}
        car["visible"] = [1, 1, 0]
        car["activity"] = "turning"

    change(indexed, edit)
    dataset = load_dataset(indexed)
    assert dataset.attribute_names == ("UL", "FM")
    car = dataset["car_1"]
    assert car.attributes == {"FM", "UL"}
    assert dict(car.provenance) == {"FM": "manual", "UL": "computed"}
    assert car.visible.tolist() == [True, True, False]
    assert car.activity == "turning"


def test_categories_of_a_plain_folder(night):
    assert [s.category for s in load_dataset(night)] == ["bike", "car"]


def test_keyframes(make, tmp_path):
    make.frames(tmp_path / "k" / "data_seq" / "person1", 5)
    make.rows(tmp_path / "k" / "anno_keyframes" / "person1.txt", [(1, 1, 2, 3, 4), (4, 5, 6, 7, 8)])
    write_index(index_dataset(tmp_path / "k"), tmp_path / "k" / "nat-bench.json")
    (sequence,) = load_dataset(tmp_path / "k", unannotated=True)
    assert sequence.keyframes.tolist() == [0, 3]
    assert sequence.boxes[3].tolist() == [5, 6, 7, 8]
    assert np.isnan(sequence.boxes[1]).all()
    assert not len(load_dataset(tmp_path / "k"))


def test_an_unaltered_folder_is_valid(indexed):
    report = validate(indexed)
    assert report.ok
    assert report.index == "index nat-bench.json (nat-bench/1)"
    assert any("5 checksums" in note for note in report.notes)


def test_altered_extra_and_missing_files_are_named(indexed, make):
    car = indexed / "data_seq" / "car_1"
    (car / "00002.jpg").write_bytes(make.encoded(seed=9))
    (car / "00004.jpg").write_bytes(make.encoded())
    (indexed / "data_seq" / "bike_2" / "00001.jpg").unlink()
    make.frames(indexed / "data_seq" / "bus", 1)
    found = problems(indexed)
    assert ("altered", "car_1: 00002.jpg altered, by size or checksum") in found
    assert ("extra", "car_1: 00004.jpg not named by the index") in found
    assert ("extra", "bus: not in index nat-bench.json (nat-bench/1)") in found
    (missing,) = [message for kind, message in found if kind == "frame"]
    assert "1 of 2 frames are not in" in missing
    assert "00001.jpg" in missing
    with pytest.raises(DatasetIncomplete, match="bike_2: 1 of 2 frames"):
        load_dataset(indexed)


def test_an_altered_byte_of_the_same_size_is_found(indexed):
    path = indexed / "data_seq" / "bike_2" / "00002.jpg"
    raw = bytearray(path.read_bytes())
    raw[len(raw) // 2] ^= 1
    path.write_bytes(raw)
    assert problems(indexed)[-1][0] == "altered"


def test_boxes_are_compared_exactly(indexed, make):
    rows = [(1, 2, 3, 4), (0.5000001, -1, 0, 0), [np.nan] * 4]
    text = "".join(",".join(map(str, row)) + "\n" for row in rows)
    (indexed / "anno" / "car_1.txt").write_text(text)
    ((kind, message),) = problems(indexed)
    assert kind == "annotation"
    assert "1 boxes in" in message
    assert "frame 1 (counted from 0): 0.5000001,-1.0,0.0,0.0, in the index 0.5,-1.0" in message
    make.rows(indexed / "anno" / "car_1.txt", 2)
    assert "2 boxes in" in problems(indexed)[0][1]


def test_a_second_index_keeps_words_and_takes_new_files(indexed, make):
    def edit(plain):
        plain["licence"] = "CC0"
        plain["sequences"][1]["category"] = "taxi"

    change(indexed, edit)
    make.frames(indexed / "data_seq" / "car_1", 4)
    make.rows(indexed / "anno" / "car_1.txt", 4)
    make.apart(indexed, {"bus_1": 2})
    document = index_dataset(indexed)
    assert document.licence == "CC0"
    assert [s.name for s in document.sequences] == ["bike_2", "bus_1", "car_1"]
    car = document.sequences[2]
    assert (car.category, car.frames.count, len(car.boxes)) == ("taxi", 4, 4)
    with pytest.raises(UsageError, match="--force"):
        write_index(document, indexed / "nat-bench.json")
    write_index(document, indexed / "nat-bench.json", force=True)
    assert validate(indexed).ok


@pytest.mark.parametrize("folder", ["../outside", "/etc", "data_seq/../../outside"])
def test_an_index_that_names_files_outside_is_refused(indexed, folder):
    change(indexed, lambda plain: plain["sequences"][0]["frames"].update(folder=folder))
    for call in (load_dataset, describe, validate):
        with pytest.raises(AnnotationInvalid, match="leads out") as caught:
            call(indexed)
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize("whole", [True, False])
def test_a_link_out_of_the_folder_is_refused(indexed, tmp_path, whole):
    folder = indexed / "data_seq" / "car_1"
    outside = tmp_path / "outside"
    if whole:
        folder.rename(outside)
        folder.symlink_to(outside)
    else:
        outside.mkdir()
        (folder / "00001.jpg").rename(outside / "00001.jpg")
        (folder / "00001.jpg").symlink_to(outside / "00001.jpg")
    with pytest.raises(NatBenchError, match="out of"):
        load_dataset(indexed)
    assert not validate(indexed).ok


def test_links_inside_the_folder_are_followed(indexed):
    folder = indexed / "data_seq" / "car_1"
    (folder / "00001.jpg").unlink()
    (folder / "00001.jpg").symlink_to(folder / "00002.jpg")
    assert validate(indexed).ok


def test_broken_indexes_are_refused_in_one_line(indexed):
    def version(plain):
        plain["schema"] = "nat-bench/9"

    def field(plain):
        plain["sequences"][0]["boxs"] = []

    def twice(plain):
        plain["sequences"].append(plain["sequences"][0])

    def short(plain):
        plain["sequences"][0]["boxes"].pop()

    whole = (indexed / "nat-bench.json").read_bytes()
    for edit, words in (
        (version, "schema 'nat-bench/9'"),
        (field, r"unknown field `boxs` - at `\$.sequences\[0\]`"),
        (twice, "'bike_2' comes 2 times"),
        (short, "1 boxes, but 2 frames"),
    ):
        (indexed / "nat-bench.json").write_bytes(whole)
        change(indexed, edit)
        with pytest.raises(AnnotationInvalid, match=words) as caught:
            load_dataset(indexed)
        assert str(indexed / "nat-bench.json") in str(caught.value)
        assert "\n" not in str(caught.value)


def test_faulty_folders_are_not_indexed(night, make):
    make.rows(night / "anno" / "car_1.txt", 2)
    with pytest.raises(DatasetIncomplete, match="car_1: 2 boxes in"):
        index_dataset(night)


def test_two_targets_in_one_folder_of_frames(indexed):
    document = read_dataset(indexed / "nat-bench.json")
    car = document.sequences[1]
    other = msgspec.structs.replace(car, name="other", boxes=((9, 9, 9, 9),) * 3)
    both = msgspec.structs.replace(document, sequences=(*document.sequences, other))
    (indexed / "nat-bench.json").write_bytes(encode_dataset(both))
    assert load_dataset(indexed)["other"].boxes[0].tolist() == [9, 9, 9, 9]
    assert validate(indexed).ok


def test_a_name_that_is_no_text_is_refused(make, tmp_path):
    make.frames(tmp_path / "n" / "car", 1)
    make.rows(tmp_path / "n" / "car" / "groundtruth.txt", 1)
    frame = os.fsencode(tmp_path / "n" / "car") + b"/\xff.jpg"
    os.rename(tmp_path / "n" / "car" / "00001.jpg", frame)  # noqa: PTH104
    with pytest.raises(AnnotationInvalid):
        index_dataset(tmp_path / "n")


def test_info_takes_the_words_of_the_index(indexed):
    def edit(plain):
        plain.update(title="My night", licence="CC0", citation="me 2024")
        plain["sequences"][1]["activity"] = "parking"

    change(indexed, edit)
    info = describe(indexed)
    assert (info.title, info.licence, info.paper) == ("My night", "CC0", "me 2024")
    assert [(s.category, s.activity) for s in info.sequences] == [
        ("bike", "cycling"),
        ("car", "parking"),
    ]
