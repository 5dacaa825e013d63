from typing import Any

import numpy as np
import pytest

from nat2024.analysis import dataset_statistics, with_computed_attributes
from nat2024.types import Dataset


def test_one_row_a_sequence(two: Dataset) -> None:
    found = dataset_statistics(two)
    car, fast = found.sequences.to_dict(orient="records")
    assert (car["frames"], car["width"], car["height"], car["valid_boxes"]) == (4, 64, 64, 4)
    assert (fast["valid_boxes"], fast["absent_frames"]) == (3, 1)
    assert (fast["first_area"], fast["smallest_size"]) == (100, 10)
    assert fast["aspect_change"] == 8
    assert fast["largest_step"] == 30
    assert car["published"] == "LR OCC"
    assert car["computed"] == "area400-1000 LAI"
    assert car["mean_grey"] == pytest.approx(10 / 255)


def test_boxes_and_summary(two: Dataset) -> None:
    found = dataset_statistics(two)
    assert len(found.boxes) == 7
    row = found.boxes[found.boxes.sequence == "fast"].iloc[1]
    assert (row.frame, row["size"], row.step, row.relative_step) == (1, 10, 30, 3)
    assert (row.x, row.y) == (35 / 64, 5 / 64)
    summary = found.summary()
    assert summary["sequences"] == 2
    assert summary["frames"] == 8
    assert summary["frame_sizes"] == {"64x64": 2}
    assert summary["step"]["count"] == 5
    assert summary["step"]["max"] == 30
    assert summary["length"]["p50"] == 4


def test_every_sequence_counts_the_same_in_the_heat_map(two: Dataset) -> None:
    heat_map = dataset_statistics(two, every=0).heat_map
    assert heat_map.shape == (18, 32)
    assert heat_map.sum() == pytest.approx(1)
    assert heat_map[int(20 / 64 * 18), int(20 / 64 * 32)] == pytest.approx(0.5)
    assert heat_map[1, int(35 / 64 * 32)] == pytest.approx(1 / 6)


def test_co_occurrence_tells_published_from_computed(two: Dataset) -> None:
    found = dataset_statistics(two)
    table = found.co_occurrence
    assert list(table.index) == list(table.columns)
    assert list(table.index)[:4] == [
        "LR (published)",
        "OCC (published)",
        "FM (computed)",
        "LR (computed)",
    ]
    assert table.loc["LR (published)", "OCC (published)"] == 1
    assert table.loc["LR (published)", "LR (computed)"] == 0
    assert (np.asarray(table) == np.asarray(table).T).all()
    counts = found.attributes.set_index(["attribute", "provenance"]).sequences
    assert counts["LR", "published"] == 1
    assert counts["FOC", "computed"] == 1


def test_computed_attributes_are_not_counted_twice(two: Dataset) -> None:
    once = dataset_statistics(two)
    again = dataset_statistics(with_computed_attributes(two))
    assert once.attributes.equals(again.attributes)
    assert once.sequences.equals(again.sequences)


def test_without_pixels_no_frame_is_decoded(two: Dataset) -> None:
    found = dataset_statistics(two, every=0)
    assert [s.frames.asked for s in two] == [0, 0]  # type: ignore[attr-defined]
    assert "light_spread" not in found.summary()
    assert found.sequences.light_spread.isna().all()
    assert not found.co_occurrence.index.str.startswith("UL").any()


def test_without_boxes_light_is_left(make: Any) -> None:
    found = dataset_statistics(Dataset("bare", (make([]),)), every=2)
    assert found.heat_map.sum() == 0
    assert len(found.boxes) == 0
    assert len(found.light) == 2
    assert "box_size" not in found.summary()
    assert found.attributes.sequences.sum() == 0
