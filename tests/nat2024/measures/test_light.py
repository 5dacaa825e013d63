import csv
from pathlib import Path

import numpy as np
import pytest

from nat2024.errors import ArrayContract
from nat2024.measures import (
    UNEVEN_LIGHT_STOPS,
    cell_light,
    light_spread,
    local_grey,
    saturated_beside_dark,
    target_light_spread,
)

LABELS = Path(__file__).parents[2] / "data" / "uneven_light_labels.csv"


def flat(level: int) -> np.ndarray:
    return np.full((256, 256, 3), level, np.uint8)


def area_under_roc(positive: np.ndarray, negative: np.ndarray) -> float:
    larger = positive[:, None] > negative[None]
    equal = positive[:, None] == negative[None]
    return float((larger + 0.5 * equal).mean())


@pytest.fixture(scope="module")
def labelled(shared: Path) -> dict[str, np.ndarray]:
    """Spread and saturated share of the labelled images, and their labels."""
    import cv2

    lines = [line for line in LABELS.read_text().splitlines() if not line.startswith("#")]
    rows = [row for row in csv.DictReader(lines) if row["label"] != "neither"]
    images = [cv2.imread(str(shared / "realdata" / row["file"])) for row in rows]
    drone = ("night_first_frames", "darktrack")
    return {
        "lit": np.array([row["label"] == "lamp_lit" for row in rows]),
        "drone": np.array([any(word in row["file"] for word in drone) for row in rows]),
        "spread": np.array([light_spread(image) for image in images]),
        "saturated": np.array([saturated_beside_dark(image) for image in images]),
    }


@pytest.mark.shared
def test_light_spread_tells_lamp_lit_from_evenly_dark(labelled: dict[str, np.ndarray]) -> None:
    lit, spread = labelled["lit"], labelled["spread"]
    assert (lit.sum(), (~lit).sum()) == (52, 23)
    assert area_under_roc(spread[lit], spread[~lit]) == pytest.approx(0.917, abs=0.005)
    found = spread >= UNEVEN_LIGHT_STOPS
    balanced = (found[lit].mean() + (~found[~lit]).mean()) / 2
    assert balanced == pytest.approx(0.913, abs=0.005)


@pytest.mark.shared
def test_so_it_does_among_drone_frames_alone(labelled: dict[str, np.ndarray]) -> None:
    lit, spread = labelled["lit"], labelled["spread"]
    drone = labelled["drone"]
    assert (lit & drone).sum() == 37
    assert (~lit & drone).sum() == 3  # too few for a number that could be relied on
    assert area_under_roc(spread[lit & drone], spread[~lit & drone]) > 0.95


@pytest.mark.shared
def test_saturated_beside_dark_tells_them_too(labelled: dict[str, np.ndarray]) -> None:
    lit, saturated = labelled["lit"], labelled["saturated"]
    assert area_under_roc(saturated[lit], saturated[~lit]) == pytest.approx(0.863, abs=0.005)


def test_half_of_the_cells_four_times_as_bright() -> None:
    image = flat(20)
    image[:, 128:] = 80
    light = np.log2(np.array([20, 80]) / 255 + 0.04)
    assert light_spread(image) == pytest.approx((light[1] - light[0]) / 2)
    assert light_spread(flat(20)) + light_spread(flat(0)) < 1e-12


def test_dark_surfaces_in_even_light_are_no_uneven_light() -> None:
    lit_board = np.kron(np.indices((32, 32)).sum(axis=0) % 2, np.ones((8, 8)))
    board = (30 + 170 * lit_board[..., None].repeat(3, axis=2)).astype(np.uint8)
    assert light_spread(board) < 1e-12
    assert (cell_light(board) == 200 / 255).all()


def test_exposure_matters_little() -> None:
    rng = np.random.default_rng(0)
    levels = np.kron(2.0 ** rng.uniform(4, 6.9, (16, 16)), np.ones((16, 16)))
    image = levels[..., None].repeat(3, axis=2).astype(np.uint8)
    doubled = (levels[..., None].repeat(3, axis=2).astype(np.uint8) * 2).astype(np.uint8)
    assert light_spread(doubled) == pytest.approx(light_spread(image), rel=0.25)


def test_a_lamp_in_the_dark_counts_and_in_the_light_does_not() -> None:
    night = flat(10)
    night[100, 100] = 255
    assert saturated_beside_dark(night) == 1 / 256
    day = flat(120)
    day[100, 100] = 255
    assert saturated_beside_dark(day) == 0
    day[112:128] = 5  # the row of cells below the lamp's
    assert saturated_beside_dark(day) == 1 / 256


def test_light_around_the_target() -> None:
    image = flat(20)
    image[:, 128:] = 200
    at_the_edge = target_light_spread(image, np.array([118.0, 100, 20, 20]))
    assert at_the_edge == pytest.approx(light_spread(image), rel=0.05)
    assert target_light_spread(image, np.array([30.0, 30, 20, 20])) < 1e-12
    for box in ([np.nan] * 4, [5, 5, 0, 4], [900, 900, 20, 20]):
        assert np.isnan(target_light_spread(image, np.array(box, dtype=float)))


def test_grey_of_a_box_partly_outside() -> None:
    image = flat(20)
    image[:, 128:] = 80
    assert local_grey(image, np.array([-10.0, 0, 20, 20])) == 20
    assert local_grey(image, np.array([120.0, 0, 16, 20])) == 50
    assert local_grey(image, np.array([128.0, 0, 16, 20])) == 80
    assert local_grey(image, np.array([128.0, 0, 16, 20]), 2.0) == pytest.approx(65)
    assert np.isnan(local_grey(image, np.array([300.0, 0, 16, 20])))
    assert np.isnan(local_grey(image, np.full(4, np.nan)))


def test_what_is_no_image_is_refused() -> None:
    with pytest.raises(ArrayContract):
        light_spread(np.zeros((4, 4)))  # type: ignore[arg-type]
