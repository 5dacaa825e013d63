import os

import pytest

from nat2024.datasets import load_dataset
from nat2024.datasets.layouts import find_layout
from nat2024.errors import DatasetIncomplete, DatasetNotFound

LENGTHS = {"bike1": 3, "car_l3": 2}


def _lengths(dataset):
    return {s.name: len(s) for s in dataset}


@pytest.mark.parametrize(
    ("frames", "boxes"),
    [
        ("data_seq", "anno"),
        ("Sequences", "anno_revise"),
        ("sequences", "anno_revise"),
        ("data_seq", "anno_revise"),
        ("DATA_SEQ", "Anno"),
        ("train_clip", "anno"),
    ],
)
def test_frames_and_boxes_apart(tmp_path, make, frames, boxes):
    dataset = load_dataset(make.apart(tmp_path / "Night", LENGTHS, frames, boxes))
    assert _lengths(dataset) == LENGTHS
    assert dataset.name == "Night"
    assert dataset.layout == f"{frames}/ + {boxes}/"
    assert dataset["bike1"].boxes.tolist() == [[1, 2, 3, 4]] * 3
    assert dataset["bike1"].image(0).shape == (12, 16, 3)


@pytest.mark.parametrize("wrapper", ["NAT2021", "NAT2021L", "NAT2021/test"])
def test_a_wrapping_folder_is_looked_into(tmp_path, make, wrapper):
    make.apart(tmp_path / "download" / wrapper, LENGTHS)
    (tmp_path / "download" / "readme.txt").write_text("hello")
    make.frames(tmp_path / "download" / "pictures", 2)
    dataset = load_dataset(tmp_path / "download")
    assert _lengths(dataset) == LENGTHS
    assert dataset.name == "download"


def test_several_datasets_in_one_folder_are_named(tmp_path, make):
    make.apart(tmp_path / "NAT2021", LENGTHS)
    make.apart(tmp_path / "NAT2021L", LENGTHS)
    with pytest.raises(DatasetIncomplete, match=r"holds 2 datasets \(NAT2021, NAT2021L\)"):
        load_dataset(tmp_path)


def test_revised_boxes_go_before_the_first_ones_file_by_file(tmp_path, make):
    make.apart(tmp_path, LENGTHS)
    make.rows(tmp_path / "anno_revise" / "bike1.txt", [(5, 6, 7, 8)] * 3)
    dataset = load_dataset(tmp_path)
    assert dataset["bike1"].boxes[0].tolist() == [5, 6, 7, 8]
    assert dataset["car_l3"].boxes[0].tolist() == [1, 2, 3, 4]


@pytest.mark.parametrize("file", ["groundtruth_rect.txt", "groundtruth.txt", "anno.txt", "box.txt"])
@pytest.mark.parametrize("inner", ["", "img"])
def test_one_folder_a_sequence(tmp_path, make, file, inner):
    for name, count in LENGTHS.items():
        make.frames(tmp_path / name / inner, count)
        make.rows(tmp_path / name / file, count)
    (tmp_path / "preview.jpg").write_bytes(make.encoded())
    dataset = load_dataset(tmp_path)
    assert _lengths(dataset) == LENGTHS
    assert dataset.layout == f"NAME/{inner}{'/' if inner else ''} + NAME/{file}"


def test_one_folder_a_sequence_with_boxes_apart(tmp_path, make):
    for name, count in LENGTHS.items():
        make.frames(tmp_path / name, count)
        make.rows(tmp_path / "anno" / f"{name}_gt.txt", count)
    dataset = load_dataset(tmp_path)
    assert _lengths(dataset) == LENGTHS
    assert dataset["bike1"].is_annotated


def test_categories_of_sequences(tmp_path, make):
    for name in ("airplane-1", "airplane-2", "bird-1"):
        folder = tmp_path / name.split("-")[0] / name
        make.frames(folder / "img", 2)
        make.rows(folder / "groundtruth.txt", 2)
        (folder / "nlp.txt").write_text("a bird")
    dataset = load_dataset(tmp_path)
    assert [s.name for s in dataset] == ["airplane-1", "airplane-2", "bird-1"]
    assert dataset.layout.startswith("CATEGORY/NAME/img/")


def test_two_sequences_of_one_name_are_refused(tmp_path, make):
    for category in ("a", "b"):
        make.frames(tmp_path / category / "same", 1)
    with pytest.raises(DatasetIncomplete, match="two sequences are called same"):
        load_dataset(tmp_path)


@pytest.mark.parametrize("file", ["groundtruth.txt", "anno.txt", "night.txt", "other.txt"])
def test_the_images_of_one_sequence(tmp_path, make, file):
    make.frames(tmp_path / "night", 3)
    make.rows(tmp_path / "night" / file, 3)
    dataset = load_dataset(tmp_path / "night")
    assert _lengths(dataset) == {"night": 3}
    assert dataset.layout == f"images of one sequence + {file}"
    assert dataset["night"].is_annotated


def test_one_sequence_as_otb_has_it(tmp_path, make):
    make.frames(tmp_path / "Car6" / "img", 3)
    make.rows(tmp_path / "Car6" / "groundtruth_rect.txt", 3)
    assert _lengths(load_dataset(tmp_path / "Car6")) == {"Car6": 3}


def test_the_name_is_the_base_name_of_the_resolved_folder(tmp_path, make, monkeypatch):
    make.apart(tmp_path / "Night", LENGTHS)
    (tmp_path / "link").symlink_to(tmp_path / "Night")
    assert load_dataset(tmp_path / "link").name == "Night"
    monkeypatch.chdir(tmp_path / "Night")
    assert load_dataset(".").name == "Night"


def test_names_that_differ_in_case_are_different_sequences(tmp_path, make):
    make.apart(tmp_path, {"Car": 2, "car": 3})
    if len(list((tmp_path / "data_seq").iterdir())) < 2:
        pytest.skip("this file system does not tell cases apart")
    assert _lengths(load_dataset(tmp_path)) == {"Car": 2, "car": 3}


def test_box_files_in_another_case(tmp_path, make):
    make.frames(tmp_path / "data_seq" / "Bike1", 2)
    make.rows(tmp_path / "anno" / "bike1.TXT", 2)
    assert load_dataset(tmp_path)["Bike1"].is_annotated


def test_stray_files_are_no_frames_and_no_sequences(tmp_path, make):
    make.apart(tmp_path, LENGTHS)
    (tmp_path / "data_seq" / "bike1" / "Thumbs.db").write_bytes(b"x")
    (tmp_path / "data_seq" / "bike1" / "._00001.jpg").write_bytes(b"x")
    (tmp_path / "data_seq" / "list.txt").write_text("bike1")
    (tmp_path / "data_seq" / ".DS_Store").write_bytes(b"x")
    (tmp_path / "__MACOSX").mkdir()
    (tmp_path / "anno" / "README.txt").write_text("hello")
    assert _lengths(load_dataset(tmp_path)) == LENGTHS


def test_each_wrong_folder_gets_one_clear_line(tmp_path, make):
    file = tmp_path / "file.txt"
    file.write_text("x")
    with pytest.raises(DatasetNotFound, match=r"file\.txt: a file, but a dataset is a folder"):
        find_layout(file)
    with pytest.raises(DatasetNotFound, match=r"absent: no such folder"):
        find_layout(tmp_path / "absent")
    (tmp_path / "empty").mkdir()
    with pytest.raises(DatasetNotFound, match=r"empty: the folder is empty; expected data_seq"):
        find_layout(tmp_path / "empty")
    (tmp_path / "empty" / "sub" / "sub").mkdir(parents=True)
    with pytest.raises(DatasetNotFound, match=r"empty: no images in it"):
        find_layout(tmp_path / "empty")
    (tmp_path / "apart" / "data_seq" / "a").mkdir(parents=True)
    with pytest.raises(DatasetNotFound, match=r"apart: no images in it"):
        find_layout(tmp_path / "apart")
    with pytest.raises(DatasetNotFound, match="neither a registered dataset nor a folder"):
        load_dataset("x" * 5000)
    for error in ("\n", "\0"):
        with pytest.raises(DatasetNotFound):
            load_dataset(f"a{error}b")


@pytest.mark.parametrize("name", [b"line\nbreak", b"latin\xe9"])
def test_names_that_cannot_be_written_down_are_refused(tmp_path, make, name):
    folder = tmp_path / "data_seq" / os.fsdecode(name)
    try:
        make.frames(folder, 1)
    except (OSError, UnicodeError):
        pytest.skip("this file system has no such names")
    with pytest.raises(DatasetIncomplete, match="not a printable name"):
        load_dataset(tmp_path)


def test_frames_start_where_the_listing_starts(tmp_path, make):
    """N04035 of NAT2021-test begins with image 000027.jpg."""
    make.frames(tmp_path / "data_seq" / "N04035", 3, first=27, digits=6)
    make.rows(tmp_path / "anno" / "N04035.txt", 3)
    frames = load_dataset(tmp_path)["N04035"].frames
    assert [frames.path(i).name for i in (0, 2)] == ["000027.jpg", "000029.jpg"]
