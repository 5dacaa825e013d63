from typing import Any

import numpy as np

from nat2024.analysis import (
    attribute_document,
    attribute_rows,
    computed_attributes,
    frame_rows,
)
from nat2024.types import Dataset


def computed(dataset: Dataset, **options: Any) -> Any:
    return {s.name: computed_attributes(s, **options) for s in dataset}


def test_document_holds_published_and_computed_labels_apart(two: Dataset) -> None:
    document = attribute_document(two, computed(two), per_frame=True)
    assert document["provenance"] == "computed"
    assert document["rules"]["low_area"] == 400
    assert list(document["meanings"])[:2] == ["FM", "LR"]
    car, fast = document["sequences"]
    assert car["published"] == {"LR": True, "OCC": True}
    assert car["computed"]["LR"] is False
    assert fast["published"] == {"LR": False, "OCC": False}
    assert fast["frames"]["FM"] == [1]
    assert fast["frames"]["FOC"] == [3]
    assert fast["frames_looked_at"] == 4
    (agreement,) = document["agreement"]
    assert (agreement["attribute"], agreement["share"]) == ("LR", 0)
    assert "frames" not in attribute_document(two, computed(two))["sequences"][0]


def test_rows_of_sequences(two: Dataset) -> None:
    head, *rows = attribute_rows(two, computed(two, pixels=False))
    assert head[:5] == ["sequence", "provenance", "LR", "OCC", "FM"]
    found = {(row[0], row[1]): dict(zip(head[2:], row[2:], strict=True)) for row in rows}
    assert len(found) == 4
    assert found["car", "published"] == {**dict.fromkeys(head[2:], ""), "LR": "1", "OCC": "1"}
    assert found["fast", "computed"]["OCC"] == ""
    assert found["fast", "computed"]["FM"] == "1"
    assert "UL" not in head


def test_rows_of_frames_leave_out_what_was_not_looked_at(two: Dataset, make: Any) -> None:
    boxes = [[0, 0, 10, 10], [np.nan] * 4, [0, 0, 30, 30]]
    some = make(boxes, name="some", keyframes=np.array([0, 2]))
    dataset = Dataset("three", (*two.sequences, some))
    head, *rows = frame_rows(dataset, computed(dataset, every=2))
    assert head[:3] == ["sequence", "frame", "provenance"]
    found = {(row[0], row[1]): dict(zip(head[3:], row[3:], strict=True)) for row in rows}
    assert len(found) == 11
    assert {row[2] for row in rows} == {"computed"}
    assert found["fast", "1"]["FM"] == "1"
    assert [found["car", str(n)]["LAI"] for n in range(4)] == ["1", "", "1", ""]
    assert [found["some", str(n)]["LR"] for n in range(3)] == ["1", "", "0"]
    assert [found["some", str(n)]["FM"] for n in range(3)] == ["", "", ""]


def test_nothing_computed_gives_headings_alone(two: Dataset) -> None:
    assert list(frame_rows(two, {})) == [["sequence", "frame", "provenance"]]
    assert attribute_document(two, {})["sequences"] == []


def test_what_a_person_labelled_is_not_published(make: Any) -> None:
    names = frozenset({"FM", "OCC"})
    mine = make([[0, 0, 30, 30]] * 2, attributes=names, provenance={"OCC": "manual"})
    dataset = Dataset("mine", (mine,), attribute_names=("FM",))
    (entry,) = attribute_document(dataset, computed(dataset, pixels=False))["sequences"]
    assert entry["published"] == {"FM": True}
