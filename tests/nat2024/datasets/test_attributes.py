import pytest

from nat2024.datasets import load_dataset
from nat2024.datasets.annotations import read_attributes, read_keyframes
from nat2024.errors import BoxFileError

NAT = ("ARC", "BC", "CM", "FM", "FOC", "IV", "LAI", "OV", "POC", "SV", "SOB", "VC")


@pytest.fixture
def nat(tmp_path, make):
    """Two sequences of NAT2021-test."""
    return make.published(tmp_path / "NAT2021-test", "nat2021_test", ["N02001", "N02063"])


def _flags(folder, name, text):
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"{name}.txt").write_text(text)


@pytest.mark.parametrize("where", ["att", "anno/att", "Att"])
@pytest.mark.parametrize("by_path", [True, False])
def test_attributes_in_published_order(nat, where, by_path):
    _flags(nat / where, "N02001", "1,0,0,1,0,0,1,0,0,0,0,1\r\n")
    _flags(nat / where, "N02063", "0 0 0 0 0 0 0 0 0 0 0 0")
    dataset = load_dataset(nat) if by_path else load_dataset("nat2021_test", nat)
    assert dataset["N02001"].attributes == {"ARC", "FM", "LAI", "VC"}
    assert dataset["N02063"].attributes == frozenset()
    assert dataset.attribute_names == NAT


def test_no_attribute_files_no_attribute_names(nat):
    assert load_dataset(nat).attribute_names == ()


def test_wrong_attribute_files_are_named_and_the_sequence_stays(nat, log_lines):
    _flags(nat / "att", "N02001", "1,0,0")
    _flags(nat / "att", "N02063", "0,0,0,0,0,0,0,0,0,0,0,7")
    dataset = load_dataset(nat)
    assert len(dataset) == 2
    assert dataset["N02001"].attributes == frozenset()
    assert "3 columns, expected 12 (ARC, BC" in log_lines()[0]
    assert "N02063.txt: expected a row of 0 and 1" in log_lines()[0]


def test_low_ambient_intensity_of_uavdark70_comes_from_the_published_list(tmp_path, make):
    make.published(tmp_path, "uavdark70", ["bike1", "bike2", "bike4", "car10"])
    dataset = load_dataset(tmp_path)
    assert [s.name for s in dataset if "LAI" in s.attributes] == ["bike1", "bike2", "car10"]
    assert dataset.attribute_names == ("LAI",)
    _flags(tmp_path / "att", "bike1", "0,1,1,0,0")
    dataset = load_dataset("uavdark70", tmp_path)
    assert dataset["bike1"].attributes == {"FM", "LR", "LAI"}
    assert dataset.attribute_names == ("VC", "FM", "LR", "OCC", "IV", "LAI")


def test_files_of_an_unknown_dataset_are_not_guessed_at(tmp_path, make, log_lines):
    make.apart(tmp_path, {"mine": 2})
    _flags(tmp_path / "att", "mine", "1,0,0,1,0,0,1,0,0,0,0,1")
    dataset = load_dataset(tmp_path)
    assert dataset["mine"].attributes == frozenset()
    assert len(log_lines()) == 1
    assert "order of their columns is not known" in log_lines()[0]


def test_one_value_a_line(tmp_path):
    _flags(tmp_path, "a", "0\n1\n0\n")
    assert read_attributes(tmp_path / "a.txt", ("SV", "ARV", "OCC")) == {"ARV"}


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "no boxes"),
        ("# only a comment\n", "no boxes"),
        ("0,1,2,3,4\n", "frame 0 is none of the 5 frames"),
        ("6,1,2,3,4\n", "frame 6 is none"),
        ("1.5,1,2,3,4\n", "frame 1.5 is none"),
        ("nan,1,2,3,4\n", "frame nan is none"),
        ("2,1,2,3,4\n2,1,2,3,4\n", "frame 2 has two boxes"),
        ("1,2,3,4\n", "line 1"),
    ],
)
def test_wrong_keyframes(tmp_path, text, reason):
    _flags(tmp_path, "a", text)
    with pytest.raises(BoxFileError, match=reason):
        read_keyframes(tmp_path / "a.txt", 5)
