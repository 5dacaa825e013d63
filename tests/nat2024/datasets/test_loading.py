import math
import pickle
from pathlib import Path

import numpy as np
import pytest

import nat2024
from nat2024.datasets import load_dataset
from nat2024.errors import BoxFileError, DatasetIncomplete, DatasetNotFound, UsageError

LENGTHS = {"bike1": 3, "car_l3": 2}


def test_boxes_are_exactly_as_stored(tmp_path, make):
    """Interpolated annotation is fractional; absent rows are NaN; zero sizes stay."""
    make.frames(tmp_path / "data_seq" / "a", 4)
    rows = [(100.2, 50.25, 10, 20.5), (math.nan,) * 4, (0, -3, 0, 0), (1, 2, 3, 4)]
    make.rows(tmp_path / "anno" / "a.txt", rows)
    sequence = load_dataset(tmp_path)["a"]
    np.testing.assert_array_equal(sequence.boxes, rows)
    assert sequence.boxes.dtype == np.float64
    assert sequence.visible is None
    assert sequence.attributes == frozenset()


def test_a_sequence_of_one_frame(tmp_path, make):
    make.apart(tmp_path, {"a": 1})
    assert load_dataset(tmp_path)["a"].boxes.shape == (1, 4)


def test_sequences_without_annotation_are_left_out_and_named_in_one_line(tmp_path, make, log_lines):
    make.apart(tmp_path, LENGTHS)
    make.frames(tmp_path / "data_seq" / "dark", 4)
    make.frames(tmp_path / "data_seq" / "darker", 5)
    dataset = load_dataset(tmp_path)
    assert [s.name for s in dataset] == ["bike1", "car_l3"]
    assert dataset.unannotated == ("dark", "darker")
    assert len(log_lines()) == 1
    assert "dark, darker" in log_lines()[0]
    everything = load_dataset(tmp_path, unannotated=True)
    assert [s.name for s in everything] == ["bike1", "car_l3", "dark", "darker"]
    assert everything["dark"].boxes.shape == (0, 4)
    assert not everything["dark"].is_annotated
    assert everything.unannotated == ()


def test_sequences_with_keyframes_only(tmp_path, make, log_lines):
    make.apart(tmp_path, {"a": 2})
    make.frames(tmp_path / "data_seq" / "b", 6)
    file = tmp_path / "anno_keyframes" / "b.txt"
    file.parent.mkdir()
    file.write_text("# frame(1-based),x,y,w,h\n5,1,2,3,4\n1,5,6,7,8.5\n")
    assert [s.name for s in load_dataset(tmp_path)] == ["a"]
    assert "b" in log_lines()[0]
    sequence = load_dataset(tmp_path, unannotated=True)["b"]
    assert sequence.keyframes is not None
    assert sequence.keyframes.tolist() == [0, 4]
    assert sequence.boxes[0].tolist() == [5, 6, 7, 8.5]
    assert sequence.boxes[4].tolist() == [1, 2, 3, 4]
    assert np.isnan(sequence.boxes[[1, 2, 3, 5]]).all()
    assert not sequence.is_annotated


def test_all_sequences_that_do_not_fit_are_named_with_both_counts(tmp_path, make):
    make.apart(tmp_path, {"a": 3, "b": 3, "c": 3})
    make.rows(tmp_path / "anno" / "a.txt", 2)
    make.rows(tmp_path / "anno" / "c.txt", 5)
    with pytest.raises(DatasetIncomplete) as caught:
        load_dataset(tmp_path)
    message = str(caught.value)
    assert "a: 2 boxes" in message
    assert "c: 5 boxes" in message
    assert message.count("but 3 images") == 2
    assert "b:" not in message
    assert "\n" not in message


def test_lenient_cuts_to_the_shorter_and_says_so(tmp_path, make, log_lines):
    make.apart(tmp_path, {"a": 3, "b": 3, "c": 3})
    make.rows(tmp_path / "anno" / "a.txt", 2)
    make.rows(tmp_path / "anno" / "c.txt", 5)
    dataset = load_dataset(tmp_path, lenient=True)
    assert [(len(s), len(s.boxes)) for s in dataset] == [(2, 2), (3, 3), (3, 3)]
    assert any("a (2 boxes, 3 images), c (5 boxes, 3 images)" in line for line in log_lines())


def test_unreadable_boxes_name_file_and_line_even_when_lenient(tmp_path, make):
    make.apart(tmp_path, {"a": 3, "b": 3})
    (tmp_path / "anno" / "a.txt").write_text("1,2,3,4\n1,2,x,4\n1,2,3,4\n")
    with pytest.raises(BoxFileError, match=r"a\.txt, line 2"):
        load_dataset(tmp_path, lenient=True)
    make.rows(tmp_path / "anno" / "b.txt", 2)
    with pytest.raises(DatasetIncomplete, match=r"a\.txt, line 2.*b: 2 boxes"):
        load_dataset(tmp_path)


def test_boxes_without_images(tmp_path, make, log_lines):
    make.apart(tmp_path, LENGTHS)
    (tmp_path / "data_seq" / "empty").mkdir()
    make.rows(tmp_path / "anno" / "gone.txt", 3)
    assert len(load_dataset(tmp_path)) == 2
    assert any("folders without images: empty" in line for line in log_lines())
    assert any("boxes but no folder of images: gone" in line for line in log_lines())
    make.rows(tmp_path / "anno" / "empty.txt", 3)
    with pytest.raises(DatasetIncomplete, match="empty: no images in"):
        load_dataset(tmp_path, lenient=True)


def test_the_training_set_has_no_annotation(tmp_path, make, log_lines):
    for name in ("0001", "0002"):
        make.frames(tmp_path / "train_clip" / name, 2)
    dataset = load_dataset("nat2021_train", tmp_path)
    assert (dataset.name, len(dataset)) == ("nat2021_train", 0)
    assert dataset.unannotated == ("0001", "0002")
    assert len(log_lines()) == 1
    assert len(load_dataset("nat2021_train", tmp_path, unannotated=True)) == 2


def test_flags_of_got10k_and_lasot(tmp_path, make):
    for name in ("cover", "absence", "lasot"):
        make.frames(tmp_path / name, 4)
        make.rows(tmp_path / name / "groundtruth.txt", 4)
    (tmp_path / "cover" / "cover.label").write_text("8\n0\n3\n1\n")
    (tmp_path / "cover" / "absence.label").write_text("0\n0\n0\n0\n")
    (tmp_path / "absence" / "absence.label").write_text("0\n1\n0\n0\n")
    (tmp_path / "lasot" / "full_occlusion.txt").write_text("0,0,1,0")
    (tmp_path / "lasot" / "out_of_view.txt").write_text("0,0,0,1")
    dataset = load_dataset(tmp_path)
    assert dataset["cover"].visible.tolist() == [True, False, True, True]
    assert dataset["absence"].visible.tolist() == [True, False, True, True]
    assert dataset["lasot"].visible.tolist() == [True, True, False, False]
    make.rows(tmp_path / "lasot" / "groundtruth.txt", 2)
    cut = load_dataset(tmp_path, lenient=True)["lasot"]
    assert (len(cut), len(cut.visible)) == (2, 2)
    (tmp_path / "cover" / "cover.label").write_text("8\n0\n")
    with pytest.raises(DatasetIncomplete, match=r"cover\.label: 2 flags, but 4 images"):
        load_dataset(tmp_path)


def test_names_and_paths(tmp_path, make, monkeypatch):
    make.apart(tmp_path / "uavdark135", LENGTHS)
    monkeypatch.chdir(tmp_path)
    with pytest.raises(DatasetNotFound, match="dataset uavdark135 not found"):
        load_dataset("uavdark135")
    assert len(load_dataset("./uavdark135")) == 2
    assert len(load_dataset(tmp_path / "uavdark135")) == 2
    with pytest.raises(UsageError, match="belongs to a registered dataset"):
        load_dataset(tmp_path / "uavdark135", tmp_path)
    with pytest.raises(DatasetNotFound, match="closest: nat2024_1"):
        load_dataset("NAT2024-1")
    with pytest.raises(DatasetNotFound, match=r"/no/such/place: no such folder"):
        load_dataset("/no/such/place")


def test_the_sample_gives_way_to_a_root_of_ones_own(tmp_path, make):
    make.apart(tmp_path, LENGTHS)
    assert len(load_dataset("night_mini")) == 6
    assert {s.name for s in load_dataset("night_mini", tmp_path)} == set(LENGTHS)


def test_a_registered_dataset_says_what_differs_from_the_published_list(tmp_path, make, log_lines):
    make.published(tmp_path, "darktrack2021", ["car_7", "car_31", "person_1"])
    make.apart(tmp_path, {"new": 2})
    dataset = load_dataset("darktrack2021", tmp_path)
    assert dataset.name == "darktrack2021"
    assert len(dataset) == 4
    assert "107 of 110 missing" in log_lines()[0]
    assert "1 not in the published list: new" in log_lines()[0]


def test_nat2024_1_keeps_the_forty_that_are_reported(tmp_path, make, log_lines):
    make.published(tmp_path, "nat2024_1", ["L06002", "L05012"])
    make.apart(tmp_path, {"L05009": 1450, "L05018": 20}, data=b"")
    dataset = load_dataset("nat2024_1", tmp_path)
    assert [s.name for s in dataset] == ["L05012", "L06002"]
    assert "L05009, L05018" in log_lines()[0]
    by_path = load_dataset(tmp_path)
    assert [s.name for s in by_path] == ["L05012", "L06002"]
    long = load_dataset("nat2024_1", tmp_path, rule="length")
    assert [s.name for s in long] == ["L05009", "L05012", "L06002"]
    assert len(load_dataset("nat2024_1", tmp_path, rule="all")) == 4
    with pytest.raises(UsageError, match="no published rule"):
        load_dataset(make.apart(tmp_path / "other", LENGTHS), rule="length")


def test_datasets_load_in_other_processes(tmp_path, make):
    make.apart(tmp_path, LENGTHS)
    dataset = load_dataset(tmp_path)
    again = pickle.loads(pickle.dumps(dataset))
    assert [s.start_digest() for s in again] == [s.start_digest() for s in dataset]
    assert (again["bike1"].image(2) == dataset["bike1"].image(2)).all()


def test_the_public_names_lead_here():
    assert nat2024.load_dataset is load_dataset
    assert "nat2024_2" in nat2024.list_datasets()


@pytest.mark.shared
def test_real_data(shared):
    dataset = load_dataset(shared / "realdata")
    lengths = {"dtb70_MountainBike6": 81, "dtb70_Surfing06": 106}
    lengths |= {"uav123_wakeboard7": 67, "uavdt_S1301a": 240}
    assert {s.name: len(s) for s in dataset} == lengths
    assert dataset.unannotated == ("bobot_juice", "night_person11")
    assert dataset["dtb70_Surfing06"].boxes[1].tolist() == [722.5, 308, 41, 60]
    everything = load_dataset(shared / "realdata", unannotated=True)
    assert len(everything) == 6
    juice, person = everything["bobot_juice"], everything["night_person11"]
    assert (len(juice.keyframes), len(person.keyframes)) == (16, 23)
    assert person.boxes[10].tolist() == [527, 227.5, 50.5, 135]
    assert {s.name: s.frame_size for s in everything}["bobot_juice"] == (320, 240)
    for sequence in everything:
        width, height = sequence.frame_size
        assert sequence.image(len(sequence) - 1).shape == (height, width, 3)


def test_a_dataset_tells_how_it_is_loaded_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from nat2024.datasets import load_again, write_sequence
    from nat2024.night import Clip, render_clip

    clip = Clip("a", frames=3, size=(64, 48), target_size=(10, 8))
    write_sequence(tmp_path / "clip", "a", render_clip(clip))
    monkeypatch.chdir(tmp_path)
    dataset = load_dataset("clip", lenient=True)
    assert dataset.origin is not None
    assert dataset.origin.source == str(tmp_path / "clip")
    assert dataset.origin.lenient
    assert dataset.select(["a"]).origin == dataset.origin
    monkeypatch.chdir("/")
    assert load_again(dataset.origin).sequences[0].start_digest() == dataset["a"].start_digest()
