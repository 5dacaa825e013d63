"""First rows tell the pixel origin of a writer, and results of another video."""

import numpy as np
import pytest

from nat2024.importing import compare_first_rows

TRUTH = {name: np.array([10.0 * k, 20.0, 30.0, 40.0]) for k, name in enumerate("abcde", 1)}


def moved(x: float, y: float) -> dict[str, np.ndarray]:
    return {name: box + np.array([x, y, 0, 0]) for name, box in TRUTH.items()}


@pytest.mark.parametrize(
    ("x", "y", "words"),
    [
        (0.5, 0.5, "(+0.5, +0.5) px from the annotation, as the testers of pysot write them"),
        (0.0, 0.0, "(+0, +0) px from the annotation, as annotated"),
        (-1.0, -1.0, "(-1, -1) px from the annotation, 0-based"),
        (-0.5, -0.5, "half a pixel off"),
        (0.3, 0.0, "(+0.3, +0) px from the annotation"),
    ],
)
def test_offsets_are_told(x: float, y: float, words: str) -> None:
    rows = compare_first_rows(moved(x, y), TRUTH)
    assert rows is not None
    assert (rows.offset, rows.alike, rows.compared, rows.others) == ((x, y), True, 5, ())
    assert words in rows.text
    assert rows.is_zero_based == (x == -1.0)


def test_a_sequence_that_was_started_elsewhere_is_named() -> None:
    first = moved(0.5, 0.5)
    first["c"] = first["c"] + np.array([40.0, 0, 0, 0])
    first["d"] = first["d"] + np.array([0, 0, 8.0, 0])
    rows = compare_first_rows(first, TRUTH)
    assert rows is not None
    assert rows.others == ("c", "d")
    assert (rows.offset, rows.alike) == ((0.5, 0.5), True)


def test_offsets_that_differ_by_half_a_pixel_are_not_alike() -> None:
    first = moved(0, 0)
    first["b"] = first["b"] - np.array([0.5, 0.5, 0, 0])
    rows = compare_first_rows(first, TRUTH)
    assert rows is not None
    assert not rows.alike
    assert "not the same everywhere" in rows.text


def test_nothing_to_compare() -> None:
    assert compare_first_rows({}, TRUTH) is None
    assert compare_first_rows({"z": TRUTH["a"]}, TRUTH) is None
    assert compare_first_rows({"a": np.full(4, np.nan)}, TRUTH) is None
