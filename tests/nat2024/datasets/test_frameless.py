"""Annotation without images: enough to score results."""

import shutil
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import nat2024
from nat2024.datasets import index_dataset, load_again, write_index
from nat2024.datasets.schema import INDEX_FILE
from nat2024.errors import DatasetIncomplete, DatasetNotFound, FrameUnreadable

LENGTHS = {"a": 3, "b": 5}


def lengths(dataset: nat2024.Dataset) -> dict[str, int]:
    assert all(len(s) == len(s.boxes) for s in dataset)
    return {s.name: len(s) for s in dataset}


def load(path: Path | str, **options: Any) -> nat2024.Dataset:
    return nat2024.load_dataset(path, unannotated=True, frameless=True, **options)


@pytest.mark.parametrize(
    ("folder", "file"),
    [
        ("", "anno/{}.txt"),
        ("", "anno/{}_gt.txt"),
        ("anno", "anno/{}.txt"),
        ("", "{}/groundtruth.txt"),
        ("", "{}/{}.txt"),
        ("", "NAT2021/test/anno/{}.txt"),
        ("", "boxes/{}.txt"),
    ],
)
def test_every_place_of_box_files(
    tmp_path: Path, make: Any, log_lines: Any, folder: str, file: str
) -> None:
    for name, count in LENGTHS.items():
        make.rows(tmp_path / file.replace("{}", name), count)
    with pytest.raises(DatasetNotFound):
        nat2024.load_dataset(tmp_path / folder)
    found = load(tmp_path / folder)
    assert lengths(found) == LENGTHS
    assert [line for line in log_lines() if "no frames of any sequence, scores need" in line]


def test_some_sequences_have_frames(tmp_path: Path, make: Any, log_lines: Any) -> None:
    make.apart(tmp_path, {"c": 4})
    make.rows(tmp_path / "anno" / "a.txt", 3)
    make.rows(tmp_path / "anno" / "empty.txt", 2)
    (tmp_path / "anno" / "list.txt").write_text("a\nc\n")
    (tmp_path / "data_seq" / "empty").mkdir()
    found = load(tmp_path)
    assert lengths(found) == {"a": 3, "c": 4, "empty": 2}
    assert found["c"].image(3).shape == (12, 16, 3)
    lines = log_lines()
    assert any("no frames of a, empty, scores need none" in line for line in lines)
    assert any("boxes but no folder of images: list" in line for line in lines)
    (tmp_path / "data_seq" / "empty").rmdir()
    assert list(lengths(nat2024.load_dataset(tmp_path))) == ["c"]


def test_pictures_beside_the_annotation_are_no_dataset(tmp_path: Path, make: Any) -> None:
    make.rows(tmp_path / "anno" / "a.txt", 3)
    make.frames(tmp_path / "figures", 2)
    assert lengths(load(tmp_path)) == {"a": 3}


def test_frames_that_are_not_there_say_so(tmp_path: Path, make: Any) -> None:
    make.rows(tmp_path / "anno" / "a.txt", 3)
    sequence = load(tmp_path)["a"]
    for read in (lambda: sequence.image(1), lambda: sequence.frame_size):
        with pytest.raises(FrameUnreadable, match=r"a: .* there.*; looked for in"):
            read()


def test_a_registered_dataset_keeps_its_name_and_attributes(tmp_path: Path, make: Any) -> None:
    names = ["bike1", "car1", "truck1"]
    whole = make.published(tmp_path / "whole", "uavdark135", names)
    expected = nat2024.load_dataset("uavdark135", whole)
    bare = tmp_path / "bare"
    shutil.copytree(whole / "anno", bare / "anno")
    for found in (load("uavdark135", root=bare), load(bare)):
        assert lengths(found) == lengths(expected)
        assert [s.attributes for s in found] == [s.attributes for s in expected]
        for one, other in zip(found, expected, strict=True):
            np.testing.assert_array_equal(one.boxes, other.boxes)
            assert one.start_digest() == other.start_digest()
    assert load("uavdark135", root=bare).origin.root == str(bare)
    assert lengths(load_again(load(bare).origin, frameless=True)) == lengths(expected)


def test_an_index_whose_frames_are_gone(tmp_path: Path, make: Any) -> None:
    make.apart(tmp_path, LENGTHS)
    write_index(index_dataset(tmp_path), tmp_path / INDEX_FILE)
    shutil.rmtree(tmp_path / "data_seq" / "b")
    with pytest.raises(DatasetIncomplete, match="5 of 5 frames are not in"):
        nat2024.load_dataset(tmp_path)
    assert lengths(load(tmp_path)) == LENGTHS
    shutil.rmtree(tmp_path / "data_seq")
    assert lengths(load(tmp_path)) == LENGTHS


def test_an_archive_of_annotation(tmp_path: Path, make: Any) -> None:
    make.rows(tmp_path / "anno" / "a.txt", 3)
    with zipfile.ZipFile(tmp_path / "boxes.zip", "w") as archive:
        archive.write(tmp_path / "anno" / "a.txt", "anno/a.txt")
    assert lengths(load(tmp_path / "boxes.zip")) == {"a": 3}


@pytest.mark.parametrize(
    ("boxes", "flags"),
    [("a/groundtruth.txt", "a"), ("anno/a.txt", "data_seq/a"), ("anno/a.txt", "sequences/a")],
)
def test_flags_stay_where_only_the_images_went(
    tmp_path: Path, make: Any, boxes: str, flags: str
) -> None:
    make.rows(tmp_path / boxes, 3)
    (tmp_path / flags).mkdir(parents=True, exist_ok=True)
    (tmp_path / flags / "cover.label").write_text("8\n0\n3\n")
    assert load(tmp_path)["a"].visible.tolist() == [True, False, True]
    make.rows(tmp_path / "anno" / "b.txt", 4)
    assert lengths(load(tmp_path)) == {"a": 3, "b": 4} if boxes.startswith("anno") else {"b": 4}


def test_neither_boxes_nor_frames(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("nothing to see\n")
    with pytest.raises(DatasetNotFound, match="no images in it"):
        load(tmp_path)
