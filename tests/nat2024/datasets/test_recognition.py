import pytest

from nat2024.datasets import load_dataset, recognise, registered_dataset
from nat2024.datasets.recognition import recognise_lengths
from nat2024.errors import DatasetIncomplete

LISTED = [
    "darktrack2021",
    "nat2021_l_test",
    "nat2021_test",
    "nat2024_1",
    "nat2024_2",
    "uavdark135",
    "uavdark70",
]


def _lengths(name):
    return {key: s.frames for key, s in registered_dataset(name).sequences.items()}


@pytest.mark.parametrize("name", LISTED)
def test_a_whole_download_is_recognised(name):
    assert recognise_lengths(_lengths(name)).name == name


@pytest.mark.parametrize("name", LISTED)
def test_half_a_download_with_some_frames_missing_is_recognised(name):
    lengths = dict(list(_lengths(name).items())[::2])
    altered = {key: n - (i % 5 == 0) for i, (key, n) in enumerate(lengths.items())}
    assert recognise_lengths(altered).name == name


def test_names_alone_do_not_tell():
    """NAT2021-test and NAT2021-L-test share 23 names for different videos."""
    test, long_term = _lengths("nat2021_test"), _lengths("nat2021_l_test")
    shared = sorted(test.keys() & long_term.keys())
    assert recognise_lengths({key: test[key] for key in shared}).name == "nat2021_test"
    assert recognise_lengths({key: long_term[key] for key in shared}).name == "nat2021_l_test"
    unknown = recognise_lengths({key: 7 for key in shared})
    assert unknown.name == ""
    assert unknown.facts is None
    assert {c.name for c in unknown.candidates} == {"nat2021_test", "nat2021_l_test"}


def test_sequences_that_two_datasets_share_are_not_guessed_at():
    """28 sequences of UAVDark70 are the same in UAVDark135."""
    small, large = _lengths("uavdark70"), _lengths("uavdark135")
    both = {name: n for name, n in small.items() if large.get(name) == n}
    assert recognise_lengths(both).name == ""
    only = next(name for name in small if name not in large)
    assert recognise_lengths(both | {only: small[only]}).name == "uavdark70"


def test_a_download_with_more_than_is_reported():
    lengths = _lengths("nat2024_1") | {f"L11{i:03d}": 900 for i in range(60)}
    assert recognise_lengths(lengths).name == "nat2024_1"


def test_the_alternative_length_of_person_9_counts():
    assert recognise_lengths({"person_9": 298}).name == "darktrack2021"


def test_loaded_datasets(tmp_path, make):
    make.published(tmp_path / "any name", "nat2021_l_test", ["N01001", "N03001"])
    dataset = load_dataset(tmp_path / "any name")
    assert dataset.name == "any name"
    assert recognise(dataset).name == "nat2021_l_test"
    make.frames(tmp_path / "clips" / "train_clip" / "0001", 1)
    clips = load_dataset(tmp_path / "clips", unannotated=True)
    assert recognise(clips).name == "nat2021_train"
    make.apart(tmp_path / "mine", {"x": 1})
    assert recognise(load_dataset(tmp_path / "mine")).name == ""


def test_a_registered_name_with_the_folder_of_another_is_refused(tmp_path, make):
    make.published(tmp_path, "nat2021_l_test", ["N01001"])
    with pytest.raises(DatasetIncomplete, match="holds nat2021_l_test instead"):
        load_dataset("nat2021_test", tmp_path)
    assert len(load_dataset("nat2021_l_test", tmp_path)) == 1


def test_of_two_datasets_in_one_folder_the_one_asked_for_is_taken(tmp_path, make):
    make.published(tmp_path / "NAT2021" / "test", "nat2021_test", ["N02063"])
    make.published(tmp_path / "NAT2021" / "long", "nat2021_l_test", ["N03001"])
    assert [s.name for s in load_dataset("nat2021_test", tmp_path)] == ["N02063"]
    assert [s.name for s in load_dataset("nat2021_l_test", tmp_path)] == ["N03001"]
    with pytest.raises(DatasetIncomplete, match="holds 2 datasets"):
        load_dataset("nat2024_2", tmp_path)
