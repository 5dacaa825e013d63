from pathlib import Path
from typing import Any

import pytest

from nat2024.datasets import (
    ATTRIBUTE_COLUMNS,
    attribute_columns,
    list_datasets,
    load_dataset,
    registered_dataset,
    with_attribute_files,
)
from nat2024.errors import BoxFileError, DatasetIncomplete, UsageError
from nat2024.types import Dataset


@pytest.fixture
def folder(tmp_path: Path, make: Any) -> Path:
    make.apart(tmp_path, {"one": 2, "two": 2})
    (tmp_path / "att").mkdir()
    (tmp_path / "att" / "one.txt").write_text("1,1,0,1,0,0,0,0,1,1,1,1")
    (tmp_path / "att" / "two.txt").write_text("0,0,1,0,0,0,0,0,0,0,0,0")
    return tmp_path


def test_columns_of_uav123(folder: Path) -> None:
    found = with_attribute_files(load_dataset(folder), attribute_columns("uav123"))
    assert found["one"].attributes == {"SV", "ARC", "FM", "IV", "VC", "CM", "SOB"}
    assert found["two"].attributes == {"LR"}
    assert found.attribute_names == ATTRIBUTE_COLUMNS["uav123"]


def test_known_columns_are_those_of_the_registered_datasets() -> None:
    numbers = {"uav123": 12, "uavdt": 9, "dtb70": 11, "lasot": 14, "nat2021": 12, "uavdark70": 5}
    assert {name: len(set(columns)) for name, columns in ATTRIBUTE_COLUMNS.items()} == numbers
    published = {name: registered_dataset(name).attribute_columns for name in list_datasets()}
    assert published["nat2021_test"] == ATTRIBUTE_COLUMNS["nat2021"]
    assert published["uavdark70"] == ATTRIBUTE_COLUMNS["uavdark70"]


def test_columns_of_ones_own() -> None:
    assert attribute_columns("SV, ARC,LR") == ("SV", "ARC", "LR")


@pytest.mark.parametrize(
    ("text", "message"),
    [("uav12", "closest: uav123"), ("SV,,LR", "neither"), ("SV,LR,SV", "comes twice")],
)
def test_wrong_columns(text: str, message: str) -> None:
    with pytest.raises(UsageError, match=message):
        attribute_columns(text)


def test_wrong_files(folder: Path) -> None:
    dataset = load_dataset(folder)
    with pytest.raises(BoxFileError, match="12 columns, expected 3"):
        with_attribute_files(dataset, ("SV", "ARC", "LR"))
    (folder / "att" / "two.txt").unlink()
    with pytest.raises(DatasetIncomplete, match=r"no attribute file \(att/NAME.txt\) of two"):
        with_attribute_files(dataset, attribute_columns("uav123"))
    with pytest.raises(DatasetIncomplete, match="of one, two"):
        with_attribute_files(Dataset("mine", dataset.sequences), attribute_columns("uav123"))
