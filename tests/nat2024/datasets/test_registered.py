import importlib.metadata
import json
from collections import Counter
from pathlib import Path

import msgspec
import pytest

from nat2024.datasets import (
    DatasetFacts,
    SequenceFacts,
    list_datasets,
    register_dataset,
    registered_dataset,
)
from nat2024.datasets import registered as module
from nat2024.errors import BrokenPlugin, DatasetNotFound, DuplicatePlugin, InvalidOption

NAMES = [
    "darktrack2021",
    "nat2021_l_test",
    "nat2021_test",
    "nat2021_train",
    "nat2024_1",
    "nat2024_2",
    "night_mini",
    "uavdark135",
    "uavdark70",
]


@pytest.fixture
def clean_registry(monkeypatch):
    monkeypatch.setattr(module, "_registered", {})


def test_all_datasets_are_listed_sorted():
    assert list_datasets() == NAMES
    assert list_datasets("nat2024*") == ["nat2024_1", "nat2024_2"]


def test_an_unknown_name_names_the_closest():
    with pytest.raises(DatasetNotFound, match=r"closest: uavdark135"):
        registered_dataset("UAVDark135")


@pytest.mark.parametrize(
    ("name", "sequences", "frames", "shortest", "longest"),
    [
        ("uavdark135", 135, 125466, 216, 4571),
        ("uavdark70", 70, 66429, 216, 3087),
        ("darktrack2021", 110, 100421, 92, 6579),
        ("nat2021_test", 180, 140815, 92, 1799),
        ("nat2021_l_test", 23, 53564, 1425, 3866),
        ("nat2024_1", 40, 70094, 1487, 2856),
        ("nat2024_2", 40, 74315, 1500, 4313),
    ],
)
def test_totals_are_the_published_ones(name, sequences, frames, shortest, longest):
    facts = registered_dataset(name)
    lengths = [s.frames for s in facts.sequences.values()]
    assert (len(lengths), facts.frames) == (sequences, frames)
    assert (min(lengths), max(lengths)) == (shortest, longest)
    assert f"{sequences} sequences, {frames} frames" in facts.summary


@pytest.mark.parametrize("name", NAMES)
def test_every_dataset_says_whose_it_is_and_where_to_get_it(name):
    facts = registered_dataset(name)
    assert facts.paper
    assert facts.licence
    assert facts.obtain
    assert facts.expected_layout
    assert facts.source
    assert facts.folders[0] == facts.title


def test_nat2021_train_claims_no_list():
    facts = registered_dataset("nat2021_train")
    assert facts.sequences == {}
    assert "1400" in facts.unchecked[0]


def test_car_9d_and_roadbloack_are_the_true_names():
    sequences = registered_dataset("nat2024_2").sequences
    assert {"car_9d", "roadbloack"} < sequences.keys()
    assert not {"car_9", "roadblock"} & sequences.keys()
    assert sequences["bike_3"].frames == 1500
    assert Counter(name.rpartition("_")[0] or name for name in sequences) == {
        "bike": 5, "bridge": 1, "building": 3, "bus": 3, "car": 13, "person": 6, "roadbloack": 1,
        "ship": 2, "subway": 1, "tower": 1, "traffic": 2, "truck": 2,
    }  # fmt: skip


def test_class_codes_hold_the_published_numbers():
    nat2021 = Counter(name[:3] for name in registered_dataset("nat2021_test").sequences)
    assert [nat2021[f"N{i:02d}"] for i in range(1, 10)] == [11, 64, 16, 46, 7, 1, 5, 24, 6]
    nat2024 = Counter(name[:3] for name in registered_dataset("nat2024_1").sequences)
    assert [nat2024[f"L{i:02d}"] for i in range(1, 11)] == [5, 1, 2, 4, 19, 2, 1, 1, 2, 3]


@pytest.mark.parametrize(
    ("name", "count"),
    [("uavdark135", 1), ("nat2021_test", 2), ("nat2021_l_test", 1), ("darktrack2021", 3)],
)
def test_first_boxes_that_touch_the_border_are_kept(name, count):
    boxes = [s.first_box for s in registered_dataset(name).sequences.values()]
    assert sum(box is not None and min(box[:2]) <= 0 for box in boxes) == count


def test_shared_names_differ_in_length():
    test, long_term = (registered_dataset(f"nat2021_{x}test").sequences for x in ("", "l_"))
    shared = test.keys() & long_term.keys()
    assert len(shared) == 23
    assert all(test[name].frames != long_term[name].frames for name in shared)
    small, large = (registered_dataset(n).sequences for n in ("uavdark70", "uavdark135"))
    shared = small.keys() & large.keys()
    equal = [name for name in shared if small[name].frames == large[name].frames]
    assert (len(shared), len(equal)) == (62, 28)
    assert all(small[name].first_box == large[name].first_box for name in equal)


def test_exceptions_of_single_sequences():
    assert registered_dataset("nat2021_test").sequences["N04035"].first_frame == 27
    assert registered_dataset("darktrack2021").sequences["person_9"].other_frames == (298,)


def test_attributes():
    nat = registered_dataset("nat2021_test").attribute_columns
    assert " ".join(nat) == "ARC BC CM FM FOC IV LAI OV POC SV SOB VC"
    assert nat == registered_dataset("nat2021_l_test").attribute_columns
    dark = registered_dataset("uavdark70")
    assert dark.attributes == ("VC", "FM", "LR", "OCC", "IV", "LAI")
    assert len(dark.labels["LAI"]) == 42
    assert "bike4" not in dark.labels["LAI"]
    assert set(dark.labels["LAI"]) < dark.sequences.keys()
    large = registered_dataset("uavdark135")
    assert large.attributes == ("VC", "FM", "LR", "OCC", "IV")
    assert "assumption" in large.attribute_note


@pytest.mark.usefixtures("clean_registry")
def test_a_dataset_of_ones_own():
    facts = DatasetFacts(title="Mine", sequences={"a": SequenceFacts(3)})
    register_dataset("mine", facts)
    register_dataset("mine", facts)
    assert "mine" in list_datasets()
    assert registered_dataset("mine") is facts
    with pytest.raises(DuplicatePlugin, match="mine"):
        register_dataset("mine", DatasetFacts(title="Other"))
    register_dataset("mine", DatasetFacts(title="Other"), override=True)
    assert registered_dataset("mine").title == "Other"
    with pytest.raises(InvalidOption, match="small letters"):
        register_dataset("Mine!", facts)


def _plug_in(monkeypatch, **values):
    points = [importlib.metadata.EntryPoint(n, v, "nat_bench.datasets") for n, v in values.items()]

    def entry_points(*, group):
        return points if group == "nat_bench.datasets" else []

    monkeypatch.setattr(importlib.metadata, "entry_points", entry_points)


def test_a_dataset_of_an_installed_package(monkeypatch):
    monkeypatch.setattr(module, "PLUGGED", DatasetFacts(title="From a package"), raising=False)
    _plug_in(monkeypatch, plugged="nat2024.datasets.registered:PLUGGED")
    assert "plugged" in list_datasets()
    assert registered_dataset("plugged").title == "From a package"


def test_broken_packages_are_named(monkeypatch):
    _plug_in(monkeypatch, absent="no_such_module:FACTS", wrong="nat2024.datasets.registered:files")
    with pytest.raises(BrokenPlugin, match=r"absent \(no_such_module:FACTS\) cannot be imported"):
        registered_dataset("absent")
    with pytest.raises(BrokenPlugin, match="is no DatasetFacts"):
        registered_dataset("wrong")


def test_a_package_cannot_take_a_bundled_name(monkeypatch):
    _plug_in(monkeypatch, uavdark135="other:FACTS")
    with pytest.raises(DuplicatePlugin, match="uavdark135"):
        list_datasets()


TITLES = {
    "UAVDark135": "uavdark135",
    "UAVDark70": "uavdark70",
    "DarkTrack2021": "darktrack2021",
    "NAT2021-test": "nat2021_test",
    "NAT2021-L-test": "nat2021_l_test",
    "NAT2024-1": "nat2024_1",
    "NAT2024-2": "nat2024_2",
}


@pytest.mark.shared
def test_facts_are_those_that_were_gathered(shared: Path):
    gathered = json.loads((shared / "spec" / "night-datasets.json").read_text())
    assert gathered.keys() == TITLES.keys()
    for title, name in TITLES.items():
        facts, theirs = registered_dataset(name), gathered[title]
        assert list(facts.attributes) == theirs.get("attributes", [])
        assert facts.frame_digits == theirs.get("frame_digits", 0)
        assert facts.sequences.keys() == theirs["sequences"].keys()
        for sequence, known in theirs["sequences"].items():
            ours = msgspec.to_builtins(facts.sequences[sequence])
            assert ours["frames"] == known["frames"]
            assert ours["first_box"] == (tuple(known["init_box"]) if "init_box" in known else None)
            assert ours["first_frame"] == known.get("first_frame_number", 1)
            assert (sequence in facts.labels.get("LAI", ())) == (known.get("LAI") == 1)
