import json

import msgspec
import pytest

from nat2024.datasets import DatasetFacts, SequenceFacts, registered_dataset, validate

FACTS = DatasetFacts(
    title="Small",
    resolution=(16, 12),
    frame_digits=5,
    sequences={
        "a": SequenceFacts(3, (1, 2, 3, 4)),
        "b": SequenceFacts(2, (1, 2, 3, 4), other_frames=(4,)),
        "c": SequenceFacts(2),
    },
)
LENGTHS = {"a": 3, "b": 2, "c": 2}


@pytest.fixture
def small(tmp_path, make):
    return make.apart(tmp_path / "Small", LENGTHS)


def _problems(report):
    return [(p.kind, p.message) for p in report.problems]


def test_a_whole_download(small):
    report = validate(small, against=FACTS)
    assert report.ok
    assert report.problems == ()
    assert report.notes == ()
    assert report.checked_against == "Small"
    assert (report.sequences, report.frames) == (3, 7)
    assert any("no ground truth is public" in line for line in report.unchecked)


def test_missing_and_extra_sequences(tmp_path, make):
    make.apart(tmp_path, {"a": 3, "car_9": 2})
    (tmp_path / "data_seq" / "b").mkdir()
    make.rows(tmp_path / "anno" / "gone.txt", 2)
    report = validate(tmp_path, against=FACTS)
    assert not report.ok
    assert _problems(report) == [
        ("missing", "c: missing"),
        ("missing", "b: the folder holds no images"),
        ("missing", "gone: boxes but no folder of images"),
        ("extra", "car_9: not in the published list"),
    ]


def test_altered_lengths_and_first_boxes(small, make):
    make.frames(small / "data_seq" / "a", 4)
    make.rows(small / "anno" / "a.txt", [(10, 20, 30, 40.5), *[(1, 2, 3, 4)] * 3])
    assert _problems(validate(small, against=FACTS)) == [
        ("length", "a: 4 frames, published 3"),
        ("first_box", "a: first box 10,20,30,40.5, published 1,2,3,4"),
    ]


def test_a_half_pixel_is_an_altered_box(small, make):
    make.rows(small / "anno" / "a.txt", [(1.5, 2.5, 3, 4)] * 3)
    assert [p.kind for p in validate(small, against=FACTS).problems] == ["first_box"]


def test_a_length_of_another_public_list_is_known(small, make):
    make.frames(small / "data_seq" / "b", 4)
    make.rows(small / "anno" / "b.txt", 4)
    report = validate(small, against=FACTS)
    assert report.ok
    assert report.notes == ("b: 4 frames, as another public list says; 2 in the official results",)


def test_annotation_that_does_not_fit_or_cannot_be_read(small, make):
    make.rows(small / "anno" / "a.txt", 2)
    (small / "anno" / "b.txt").write_text("1,2,3,4\n1,2,3\n")
    (small / "anno" / "c.txt").unlink()
    problems = _problems(validate(small, against=FACTS))
    assert [kind for kind, _ in problems] == ["annotation"] * 3
    assert "a: 2 boxes" in problems[0][1]
    assert "but 3 images" in problems[0][1]
    assert problems[1][1].startswith("b: ")
    assert "b.txt, line 2" in problems[1][1]
    assert problems[2][1] == "c: no box file"


def test_frames_that_cannot_be_decoded(small, make):
    (small / "data_seq" / "a" / "00001.jpg").write_bytes(make.encoded()[:99])
    (small / "data_seq" / "b" / "00002.jpg").write_bytes(b"")
    first, header = validate(small, against=FACTS).problems
    assert (first.kind, first.sequence) == ("frame", "a")
    assert header.message.startswith("b: 1 images cannot be read, such as ")
    assert header.message.endswith("00002.jpg (frame 1, counted from 0): the file is empty")
    every = validate(small, against=FACTS, every_frame=True)
    assert [(p.kind, p.sequence) for p in every.problems] == [("frame", "a"), ("frame", "b")]


def test_images_of_another_size(small):
    facts = msgspec.structs.replace(FACTS, resolution=(1920, 1080))
    problems = _problems(validate(small, against=facts, every_frame=True))
    assert problems[0] == ("size", "a: 00001.jpg is 16x12, published 1920x1080")
    assert len(problems) == 3


def test_image_names_are_noted(tmp_path, make):
    make.apart(tmp_path, {"b": 2, "c": 2})
    make.frames(tmp_path / "data_seq" / "a", 3, first=27)
    make.rows(tmp_path / "anno" / "a.txt", 3)
    assert validate(tmp_path, against=FACTS).notes == (
        "a: first image 00027.jpg, published number 1",
    )
    six = msgspec.structs.replace(FACTS, frame_digits=6)
    assert (
        "b: first image 00001.jpg, published names have 6 digits"
        in validate(tmp_path, against=six).notes
    )


def test_a_download_with_more_than_is_reported(small, make):
    make.apart(small, {"d": 2})
    facts = msgspec.structs.replace(FACTS, reported_only=True)
    report = validate(small, against=facts)
    assert report.ok
    assert report.notes == ("1 sequences beyond the 3 reported, as expected",)


def test_a_folder_of_ones_own(small, make):
    make.frames(small / "data_seq" / "d", 2)
    report = validate(small)
    assert report.ok
    assert report.checked_against == ""
    assert report.notes == ("1 of 4 sequences have no box for every frame",)
    assert "not recognised as a registered dataset" in report.unchecked[0]
    make.rows(small / "anno" / "a.txt", 2)
    assert not validate(small).ok


def test_names_of_a_dataset_with_other_lengths_are_a_hint(tmp_path, make):
    make.apart(tmp_path, {"car_9d": 3, "roadbloack": 3})
    report = validate(tmp_path)
    assert "nearest: nat2024_2, 2 names shared, 0 of the same length" in report.unchecked[0]
    against = validate(tmp_path, against="nat2024_2")
    assert "car_9d: 3 frames, published 1757" in [p.message for p in against.problems]


def test_a_part_of_nat2024_2_says_exactly_what_differs(tmp_path, make):
    names = ["car_9d", "roadbloack", "bike_3"]
    make.published(tmp_path, "nat2024_2", names)
    (tmp_path / "data_seq" / "bike_3" / "001500.jpg").unlink()
    report = validate("nat2024_2", tmp_path)
    assert report.checked_against == "NAT2024-2"
    messages = [p.message for p in report.problems if p.kind != "frame"]
    assert sum(m.endswith(": missing") for m in messages) == 37
    assert "bike_3: 1499 frames, published 1500" in messages
    assert any(m.startswith("bike_3: 1500 boxes") for m in messages)
    assert not any("first box" in m for m in messages)


def test_person_9_with_298_frames(tmp_path, make):
    make.frames(tmp_path / "data_seq" / "person_9", 298, digits=6, data=b"")
    first = registered_dataset("darktrack2021").sequences["person_9"].first_box
    make.rows(tmp_path / "anno" / "person_9.txt", [first] * 298)
    report = validate(tmp_path)
    assert report.checked_against == "DarkTrack2021"
    assert any("298 frames" in note and "342" in note for note in report.notes)
    assert "length" not in {p.kind for p in report.problems}


def test_n04035_begins_at_27(tmp_path, make):
    make.published(tmp_path, "nat2021_test", ["N04035"])
    assert (tmp_path / "data_seq" / "N04035" / "001624.jpg").exists()
    report = validate(tmp_path)
    assert report.checked_against == "NAT2021-test"
    assert report.notes == ()
    assert {p.kind for p in report.problems} == {"missing", "frame"}


def test_what_no_public_list_has(tmp_path, make):
    make.published(tmp_path / "one", "nat2024_1", ["L06002"])
    assert any(line.startswith("first boxes") for line in validate(tmp_path / "one").unchecked)
    make.frames(tmp_path / "train" / "train_clip" / "0001", 1)
    report = validate(tmp_path / "train")
    assert (report.checked_against, report.ok) == ("NAT2021-train", True)
    assert "no list of the sequences is published" in report.unchecked[0]
    make.published(tmp_path / "dark", "uavdark135", ["car16"])
    (tmp_path / "dark" / "att").mkdir()
    (tmp_path / "dark" / "att" / "car16.txt").write_text("1,0")
    report = validate(tmp_path / "dark")
    assert any("assumption" in line for line in report.unchecked)
    assert "attributes" in {p.kind for p in report.problems}


def test_it_is_json(small):
    decoded = json.loads(msgspec.json.encode(validate(small, against=FACTS)))
    assert decoded["ok"] is True


@pytest.mark.shared
def test_real_data_is_whole(shared):
    report = validate(shared / "realdata", every_frame=False)
    assert report.ok
    assert report.frames == 906
