"""What a target is and does, by the name of its sequence."""

import pytest

from nat2024.datasets import registered_dataset
from nat2024.datasets.categories import activity_of, category_of


def test_every_sequence_of_nat2024_2_has_a_category():
    names = registered_dataset("nat2024_2").sequences
    found = {name: category_of(name) for name in names}
    assert set(found.values()) == {
        *("bike", "bridge", "building", "bus", "car", "person", "roadblock", "ship", "subway"),
        *("tower", "traffic_light", "traffic_sign", "truck"),
    }
    assert sum(kind == "car" for kind in found.values()) == 13
    assert found["roadbloack"] == "roadblock"
    assert found["car_9d"] == "car"
    assert {name for name in names if activity_of(name)} == {f"bike_{i}" for i in range(1, 6)}


@pytest.mark.parametrize(
    ("name", "category", "activity"),
    [
        ("traffic_light", "traffic_light", ""),
        ("car_l1", "car", ""),
        ("Pedestrian_l", "person", ""),
        ("running_man2", "person", "running"),
        ("valleyballplayer1", "person", "ball game"),
        ("N02001", "", ""),
        ("L01001", "", ""),
        ("cartoon", "", ""),
        ("2024_05_01", "", ""),
        ("", "", ""),
    ],
)
def test_names(name, category, activity):
    assert (category_of(name), activity_of(name)) == (category, activity)


@pytest.mark.parametrize("dataset", ["uavdark135", "uavdark70", "darktrack2021"])
def test_named_datasets_are_covered(dataset):
    assert all(map(category_of, registered_dataset(dataset).sequences))
