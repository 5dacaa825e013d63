import json
import math

import msgspec
import pytest

from nat2024.datasets import describe, load_dataset


@pytest.fixture
def night(tmp_path, make):
    root = make.apart(tmp_path / "night", {"a": 4, "b": 2})
    make.frames(root / "data_seq" / "c", 3)
    make.rows(root / "anno" / "a.txt", [(5, 6, 7, 8), (math.nan,) * 4, (1, 2, 0, 4), (1, 2, 3, -1)])
    return root


def test_what_a_folder_holds(night):
    info = describe(night)
    assert (info.name, info.recognised_as, info.title) == ("night", "", "")
    assert info.layout == "data_seq/ + anno/"
    assert info.root == str(night)
    assert (info.frames, info.shortest, info.longest, info.mean_length) == (9, 2, 4, 3.0)
    assert info.annotated == ("a", "b")
    assert info.unannotated == ("c",)
    assert info.problems == ()
    a, _, c = info.sequences
    assert (a.frames, a.annotated, a.absent, a.zero_size) == (4, 4, 1, 2)
    assert a.first_box == (5, 6, 7, 8)
    assert (a.width, a.height) == (16, 12)
    assert (c.annotated, c.first_box) == (0, None)


def test_keyframes_are_counted(night):
    (night / "anno_keyframes").mkdir()
    (night / "anno_keyframes" / "c.txt").write_text("2,1,2,3,4\n3,nan,nan,nan,nan\n")
    info = describe(night)
    assert info.keyframed == ("c",)
    assert info.unannotated == ()
    c = info.sequences[2]
    assert (c.annotated, c.absent, c.keyframes, c.first_box) == (2, 1, True, None)


def test_faults_are_described_not_raised(night, make):
    make.rows(night / "anno" / "b.txt", 5)
    (night / "data_seq" / "c" / "00001.jpg").write_bytes(b"")
    info = describe(night)
    assert len(info.problems) == 2
    assert "b: 5 boxes" in info.problems[0]
    assert "00001.jpg" in info.problems[1]
    b, c = info.sequences[1:]
    assert (b.frames, b.annotated) == (2, 5)
    assert (c.width, c.height) == (0, 0)


def test_a_loaded_dataset_gives_the_same(night):
    loaded = describe(load_dataset(night, unannotated=True))
    assert loaded == describe(night)


def test_a_recognised_dataset_says_whose_it_is(tmp_path, make):
    make.published(tmp_path, "uavdark70", ["bike1", "bike2"])
    for info in (describe(tmp_path), describe("uavdark70", tmp_path)):
        assert info.recognised_as == "uavdark70"
        assert info.title == "UAVDark70"
        assert "ICRA 2021" in info.paper
        assert info.attributes == {"LAI": 2}


def test_it_is_json(night):
    decoded = json.loads(msgspec.json.encode(describe(night)))
    assert decoded["sequences"][0]["first_box"] == [5, 6, 7, 8]


@pytest.mark.shared
def test_real_data(shared):
    info = describe(shared / "realdata")
    assert (len(info.sequences), info.frames, info.longest) == (6, 906, 261)
    assert info.keyframed == ("bobot_juice", "night_person11")
    assert info.problems == ()
